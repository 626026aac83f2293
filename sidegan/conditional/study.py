"""How well conditions are met, by the true check of every constraint they stand for, and what they cost."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

import torch
from torch import Tensor

from sidegan.conditional.condition import Condition
from sidegan.conditional.generator import ConditionalGenerator
from sidegan.conditional.problem import variances
from sidegan.conditional.settings import NONE, StudySettings
from sidegan.design.excitation import excite, mean_distance
from sidegan.design.information import information_of
from sidegan.design.optimal import a_optimal
from sidegan.motion.dynamics import gram
from sidegan.validity import Validity, check

_EXCITATION_RATE = 12.5  # [Hz] at which excitation is taken
_INFORMATION_RATE = 5.0  # [Hz] at which information is taken


@dataclass(frozen=True)
class Outcome:
    """Trajectories under K conditions, N each."""

    valid: Tensor  # whether all of it holds over the whole period, (K, N)
    condition_number: Tensor  # cond(YᵀY), (K, N)
    distance: Tensor  # mean distance of the coefficients of each condition's trajectories [rad/s], (K,)

    def summary(self) -> dict[str, float]:
        """Share that is valid, and medians."""
        return {
            "success": float(self.valid.double().mean()),
            "condition": float(self.condition_number.median()),
            "worst_success": float(self.valid.double().mean(1).min()),
            "distance": float(self.distance.mean()),
        }


def validity(generator: ConditionalGenerator, condition: Condition, c: Tensor) -> Validity:
    """Validity of coefficients (N, J, H, 2) under a batch of one condition."""
    space = generator.space
    return check(condition.constraints(space.constraints), condition.family(space.trajectory), c)


def outcome(
    generator: ConditionalGenerator,
    conditions: Condition,
    count: int,
    random: torch.Generator,
    settled: bool = True,
) -> Outcome:
    """True physics of ``count`` trajectories under each condition, settled or as the network makes them."""
    rows = []
    body, trajectory = generator.space.constraints.body, generator.space.trajectory
    for condition in map(conditions.row, range(len(conditions))):
        c = generator.sample_each(condition.repeat(count), random, settled)
        family = condition.family(trajectory)
        number = excite(body, family, c, round(_EXCITATION_RATE * family.period)).eigenvalue_fitness
        distance = torch.tensor(mean_distance(c), dtype=torch.float64)
        rows.append((validity(generator, condition, c).valid, number, distance))
    return Outcome(*map(torch.stack, zip(*rows)))


@dataclass(frozen=True)
class Study:
    """Comparison of a generator of all conditions with dedicated generators of one condition each."""

    generator: ConditionalGenerator  # of all conditions
    dedicated: Mapping[tuple[str, int], ConditionalGenerator]  # by case and number of the condition
    settings: StudySettings  # how many of everything
    seed: Callable[[str], int]  # random seed of a label

    def tables(self, conditions: Mapping[str, Condition]) -> dict[str, Any]:
        """Rows of every case of conditions, and of every choice of links."""
        kinds = [self.case(name, drawn) for name, drawn in conditions.items()]
        choices = range(self.settings.dedicated) if "links" in conditions else ()
        return {"kinds": kinds, "links": [self.links(conditions["links"].row(k)) for k in choices]}

    def case(self, name: str, conditions: Condition) -> dict[str, Any]:
        """Row of one case: the share that is met, and the condition number's loss to dedicated generators."""
        random = torch.Generator().manual_seed(self.seed(f"study {name}"))
        count = self.settings.count * (self.settings.conditions if name == NONE else 1)
        settled = outcome(self.generator, conditions, count, random)
        raw = outcome(self.generator, conditions, count, random, settled=False)
        row: dict[str, Any] = {"kind": name, **settled.summary(), "trajectories": settled.valid.numel()}
        row |= {f"raw_{key}": raw.summary()[key] for key in ("success", "condition")}
        pairs = []
        for number in range(self.settings.dedicated):
            if (name, number) in self.dedicated:
                few = conditions.row(number)
                own = outcome(self.dedicated[name, number], few, count, random)
                shared = settled.condition_number[number].median()
                pairs.append((shared, own.condition_number[0].median(), own.valid.double().mean()))
        if not pairs:
            return row
        shared, single, share = (torch.stack(x) for x in zip(*pairs))
        ratio = (shared / single).log().mean().exp()
        facts = {"compared": shared.median(), "dedicated": single.median(), "dedicated_success": share.mean()}
        return row | {key: float(value) for key, value in facts.items()} | {"ratio": float(ratio)}

    def links(self, condition: Condition) -> dict[str, Any]:
        """Row of a choice of links: variance of their parameters, best sets, over the unconditional one's."""
        space, weights = self.generator.space, condition.links[0]
        arm, base = space.constraints.arm, space.constraints.body.base
        plain = self._pool(self.dedicated[NONE, 0], space.neutral(1))
        usual = self._variances(plain)
        weights = weights[base.columns // 10]
        best = self._best(self._pool(self.generator, condition), weights / usual)
        ratio = best / self._best(plain, weights / usual)
        named = [name for name, weight in zip(arm.link_names, condition.links[0]) if weight > 0]
        return {
            "links": ", ".join(named),
            "parameters": int((weights > 0).sum()),
            "variance": float(ratio[weights > 0].mean()),
            "worst": float(ratio[weights > 0].max()),
            "others": float(ratio[weights == 0].median()),
        }

    def _pool(self, generator: ConditionalGenerator, condition: Condition) -> Tensor:
        """Valid trajectories under a condition."""
        _, c = generator.sample(self.settings.pool, condition, self.seed("study pool"))
        return c[validity(generator, condition, c).valid]

    @property
    def _samples(self) -> int:
        return round(_INFORMATION_RATE * self.generator.space.trajectory.period)

    def _variances(self, c: Tensor) -> Tensor:
        """Variances, (p,), of the parameters from a set of trajectories."""
        body, trajectory = self.generator.space.constraints.body, self.generator.space.trajectory
        return variances(body, gram(body, trajectory, c, self._samples).sum(0, keepdim=True))[0]

    def _best(self, pool: Tensor, weights: Tensor) -> Tensor:
        """Variances, (p,), from the set of a pool that tells most about the weighted parameters."""
        body, trajectory = self.generator.space.constraints.body, self.generator.space.trajectory
        subspace = body.base.subspace
        information = information_of(body, trajectory, pool, self._samples)
        target = subspace.T @ (weights[:, None] * subspace)
        count = min(self.settings.chosen, len(pool))
        return self._variances(pool[a_optimal(information, count, target=(target + target.T) / 2)])
