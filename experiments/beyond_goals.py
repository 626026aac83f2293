"""The goals for exact physics, met or not, and for whom each way is right: all from the numbers."""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import pandas as pd

from experiments.beyond_evidence import GOOD, Evidence, arrival
from experiments.beyond_tables import called, spread, title
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.plan import RANDOM, SEEDS
from sidegan.report.style import seconds

MET, MISSED = "met", "not met"
_VALID, _CONDITION, _SECONDS = 0.99, 300.0, 180.0
_LOWER = {
    "condition": "median condition number",
    "energy": "energy per trajectory",
    "nmse": "unweighted nMSE",
    "nmse_weighted": "weighted nMSE",
    "stack": "condition number of the stacked set",
    "covariance_norm": "covariance norm of the set",
    "total": "time to the first set",
    "each": "time per further trajectory",
}
_HIGHER = {
    "success": "valid share",
    "distance": "mean distance",
    "rank": "effective rank",
    "distance_diagonal": "diversity of diag(YᵀY)",
}


class Goal(NamedTuple):
    """A goal, what was found, and whether it is met."""

    text: str
    wanted: str
    found: str
    met: bool


@dataclass(frozen=True)
class Summary:
    """One number for every pool and measure: means over trainings, sets by the D-optimal pick."""

    evidence: Evidence

    def of(self, name: str) -> dict[str, float]:
        """All measures of one pool."""
        pool = _mean(self.evidence.pools, name)
        best = self.evidence.best
        chosen = _mean(best[best.pick == plan_beyond.OPTIMAL], name)
        chosen["stack"] = chosen.pop("condition")
        first = _mean(self.evidence.first, name)
        return {**chosen, **pool, "total": first["total"], "each": first["each"]}


def goals(evidence: Evidence, name: str) -> list[Goal]:
    """The goals for exact physics beside one pool, by the means over trainings."""
    pools, first = (frame[frame.name == name] for frame in (evidence.pools, evidence.first))
    seeds = _mean(evidence.pools, SEEDS)
    cpu = first.cpu if first.cpu.notna().all() else first.training_seconds  # what others run does not count
    made = [
        _goal("valid without filtering", f"≥ {_VALID:.0%}", pools.success, pools.success.mean() >= _VALID),
        _goal("median cond(YᵀY)", f"≤ {_CONDITION:g}", pools.condition, pools.condition.mean() <= _CONDITION),
        *(
            _goal(label, f"≥ {seeds[key]:.3g}, the seeds'", pools[key], pools[key].mean() >= seeds[key])
            for key, label in (("distance", "mean distance"), ("rank", "effective rank"))
        ),
        _goal("training, CPU time of one core [s]", f"≤ {_SECONDS:g}", cpu, cpu.mean() <= _SECONDS),
    ]
    return [*made, *_set_goals(evidence, name)]


def _set_goals(evidence: Evidence, name: str) -> list[Goal]:
    best, count, made = evidence.best, evidence.task.cfg.selection.count, []
    for key, label in (("covariance_norm", "covariance norm"), ("condition", "stacked cond(YᵀY)")):
        for pick in best.pick.unique():
            part = best[best.pick == pick]
            ours, theirs = part[part.name == name][key], float(part[part.name == SEEDS][key].mean())
            text = f"{label} of the best {count}, {pick} pick"
            made.append(_goal(text, f"< {theirs:.4g}, the seeds'", ours, ours.mean() < theirs))
    return made


def _goal(text: str, wanted: str, found: pd.Series, met: bool) -> Goal:
    return Goal(text, wanted, spread(found), bool(met))


def table(found: dict[str, list[Goal]]) -> pd.DataFrame:
    """Goals for people, with two columns for each pool that they are judged for."""
    first = next(iter(found.values()))
    frame = pd.DataFrame({"goal": [goal.text for goal in first], "wanted": [goal.wanted for goal in first]})
    for name, judged in found.items():
        frame[title(name)] = [goal.found for goal in judged]
        frame[f"{title(name)}: verdict"] = [verdict(goal) for goal in judged]
    return frame.set_index("goal")


def verdict(goal: Goal) -> str:
    """Met, or not met in bold."""
    return MET if goal.met else f"**{MISSED}**"


def choices(evidence: Evidence) -> list[str]:
    """Sentences that say for whom each way is the right choice."""
    names = list(dict.fromkeys(name for name, _ in plan_beyond.pools(evidence.task)))
    known = {name: Summary(evidence).of(name) for name in names}
    source = plan_beyond.source(evidence.task)
    made = [_soonest(evidence, known), _many(evidence, known), _informative(known)]
    made += [_elsewhere(evidence)]
    made += [_wins(known, source, name) for name in names if name not in (source, RANDOM)]
    return [f"- {text}" for text in made if text]


def _soonest(evidence: Evidence, known: dict[str, dict[str, float]]) -> str:
    count = evidence.task.cfg.selection.count
    able, source = [name for name in known if name != RANDOM], plan_beyond.source(evidence.task)
    quickest = min(able, key=lambda name: known[name]["total"])
    ratio = known[source]["total"] / known[quickest]["total"]
    text = f"**One set of {count} trajectories, once**: {title(quickest)}, after "
    text += f"{seconds(known[quickest]['total'])} from nothing"
    if quickest in (SEEDS, plan_beyond.OPTIMISED):
        text += f"; `{source}` takes {ratio:,.0f} × as long, nearly all of it training. "
        text += f"An optimiser with exact gradients needs no generator for {count} trajectories."
    return text.removesuffix(".") + "."


def _many(evidence: Evidence, known: dict[str, dict[str, float]]) -> str:
    source = plan_beyond.source(evidence.task)
    first = evidence.first[evidence.first.name == source]
    once = float(evidence.first[evidence.first.name == plan_beyond.OPTIMISED].each.iloc[0])
    cost = first.cpu.mean() if first.cpu.notna().all() else first.training_seconds.mean()
    each = first.each.mean()
    if not each < once:
        return f"**Many trajectories**: the optimiser, at {seconds(once)} each, against {seconds(each)}."
    number = cost / (once - each)
    return (
        f"**More than about {number:,.0f} trajectories, or new ones on demand**: `{source}`. Its training "
        f"({seconds(cost)} of CPU time) has paid for itself then: one more valid trajectory takes "
        f"{seconds(each)}, an optimised one {seconds(once)}. Fewer are optimised sooner than generated. "
        f"Medians of the condition number: {known[source]['condition']:.3g} generated, "
        f"{known[plan_beyond.OPTIMISED]['condition']:.3g} optimised."
    )


def _elsewhere(evidence: Evidence) -> str:
    """How soon a transfer has the quality of a training from scratch; nothing where none was run."""
    frame, told = evidence.transfers, []
    for target, part in frame.groupby("target", sort=False) if len(frame) else []:
        final = float(part[part.way == plan_beyond.SCRATCH].condition.iloc[-1])
        ways = {str(way): arrival(curve, final)[0] for way, curve in part.groupby("way", sort=False)}
        steps = [_steps(ways.get(way, np.nan)) for way in (plan_beyond.TRANSFER, plan_beyond.SCRATCH)]
        end = float(part[part.way == plan_beyond.TRANSFER].success.iloc[-1])
        fallen = "" if end >= GOOD else f" (but {end:.1%} valid at its end)"
        told.append(f"{called(str(target))} {steps[0]}{fallen} against {steps[1]}")
    if not told:
        return ""
    text = "**Another arm, tool or desk**: transfer. Steps until the same quality is first there: "
    return f"{text}{'; '.join(told)} from scratch."


def _steps(steps: float) -> str:
    return "never" if np.isnan(steps) else f"{steps:g}"


def _informative(known: dict[str, dict[str, float]]) -> str:
    parts = []
    for key in ("condition", "stack", "covariance_norm", "nmse_weighted"):
        order = sorted(known, key=lambda name: known[name][key])
        told = [f"{title(name)}, {known[name][key]:.3g}" for name in order[:2]]
        parts.append(f"{_LOWER[key]}: {' (next '.join(told)})")
    return f"**The most informative ones, by D-optimal pick**: smallest {'; smallest '.join(parts)}."


def _wins(known: dict[str, dict[str, float]], source: str, name: str) -> str:
    """Where one way is better than exact physics alone."""
    ours, theirs = known[source], known[name]
    better = [label for key, label in _LOWER.items() if theirs[key] < ours[key]]
    better += [label for key, label in _HIGHER.items() if theirs[key] > ours[key]]
    count = len(_LOWER) + len(_HIGHER)
    text = f"**{title(name)}** is better than `{source}` in {len(better) or 'none'} of {count} measures"
    return f"{text}: {', '.join(better)}." if better else f"{text}."


def _mean(frame: pd.DataFrame, name: str) -> dict[str, float]:
    part = frame[frame.name == name].select_dtypes(np.number)
    return {str(key): float(x) for key, x in part.mean().items()}
