"""How well conditions are met, against generators of one condition each; stage conditional uses it."""

from collections.abc import Mapping
from typing import Any

import torch
from torch import Tensor

from sidegan.conditional import Condition, ConditionalGenerator
from sidegan.conditional.measure import Met, checked, met
from sidegan.conditional.problem import variances
from sidegan.design.information import information_of
from sidegan.design.optimal import a_optimal
from sidegan.motion.dynamics import gram
from sidegan.pipeline.plan_conditional import NONE, Conditions
from sidegan.pipeline.stages.common import finite

_RATE = 5.0  # [Hz] at which information is taken

Singles = Mapping[tuple[str, int], ConditionalGenerator]


def study(conditions: Conditions, generator: ConditionalGenerator, singles: Singles) -> dict[str, Any]:
    """What every kind of condition is worth, a row each, and what it tells about chosen links."""
    rows = [_kind(conditions, kind, generator, singles) for kind in conditions.kinds]
    links = []
    if "links" in conditions.asking.ranges.kinds:
        wanted = conditions.drawn("links")
        for number in range(conditions.task.cfg.conditional.study.dedicated):
            links.append(_links(conditions, wanted.row(number), generator, singles))
    return {"kinds": [finite(row) for row in rows], "links": [finite(row) for row in links]}


def _kind(
    conditions: Conditions, kind: str, generator: ConditionalGenerator, singles: Singles
) -> dict[str, Any]:
    """One kind: the share that meets its conditions, and the condition number's loss to dedicated ones."""
    wanted, drawn = conditions.task.cfg.conditional.study, conditions.drawn(kind)
    random = torch.Generator().manual_seed(conditions.task.number(f"study {kind}"))
    count = wanted.count * (wanted.conditions if kind == NONE else 1)
    found = met(generator, drawn, count, random)
    raw = met(generator, drawn, count, random, settled=False)
    row: dict[str, Any] = {"kind": kind, **found.summary(), "trajectories": found.valid.numel()}
    row |= {f"raw_{key}": raw.summary()[key] for key in ("success", "condition")}
    pairs = []
    for number in range(wanted.dedicated):
        if (kind, number) in singles:
            few = torch.tensor([number])
            own = met(singles[kind, number], drawn.take(few), count, random)
            pairs.append((_typical(found, number), _typical(own, 0), own.valid.double().mean()))
    if not pairs:
        return row
    mine, theirs, share = (torch.stack(x) for x in zip(*pairs))
    ratio = (mine / theirs).log().mean().exp()
    facts = {"compared": mine.median(), "dedicated": theirs.median(), "dedicated_success": share.mean()}
    return row | {key: float(value) for key, value in facts.items()} | {"ratio": float(ratio)}


def _typical(found: Met, number: int) -> Tensor:
    """Median condition number of one condition's trajectories."""
    return found.condition[number].median()


def _links(
    conditions: Conditions, wanted: Condition, generator: ConditionalGenerator, singles: Singles
) -> dict[str, Any]:
    """Variance of the chosen links' parameters from the best set, over that from an unconditional one's."""
    arm, body = conditions.task.arm, conditions.task.body
    named = [name for name, weight in zip(arm.link_names, wanted.links[0]) if weight > 0]
    weights = wanted.links[0][body.base.columns // 10]
    plain = conditions.asking.neutral(1)
    sets = {"conditioned": (generator, wanted), "unconditional": (singles[NONE, 0], plain)}
    found = {}
    usual: Tensor | None = None
    for name in ("unconditional", "conditioned"):
        pool = _pool(conditions, *sets[name])
        if usual is None:
            usual = variances(body, _grams(conditions, pool).sum(0, keepdim=True))[0]
        found[name] = _best(conditions, pool, weights / usual)
    ratio = (found["conditioned"] / found["unconditional"])[weights > 0]
    return {
        "links": ", ".join(named),
        "parameters": len(ratio),
        "variance": float(ratio.mean()),
        "worst": float(ratio.max()),
        "others": float((found["conditioned"] / found["unconditional"])[weights == 0].median()),
    }


def _pool(conditions: Conditions, generator: ConditionalGenerator, condition: Condition) -> Tensor:
    """Valid trajectories under a condition."""
    count = conditions.task.cfg.conditional.study.pool
    seed = conditions.task.number("study pool")
    _, c = generator.sample(count, condition, seed)
    return c[checked(generator, condition, c).valid]


def _grams(conditions: Conditions, c: Tensor) -> Tensor:
    trajectory = conditions.task.trajectory
    return gram(conditions.task.body, trajectory, c, round(_RATE * trajectory.period))


def _best(conditions: Conditions, pool: Tensor, weights: Tensor) -> Tensor:
    """Variances, (p,), of the parameters from the set of a pool that tells most about the weighted ones."""
    body, trajectory = conditions.task.body, conditions.task.trajectory
    subspace = body.base.subspace
    known = information_of(body, trajectory, pool, round(_RATE * trajectory.period))
    target = subspace.T @ (weights[:, None] * subspace)
    count = min(conditions.task.cfg.conditional.study.chosen, len(pool))
    chosen = a_optimal(known, count, target=(target + target.T) / 2)
    return variances(body, _grams(conditions, pool[chosen]).sum(0, keepdim=True))[0]
