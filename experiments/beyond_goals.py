"""The goals for exact physics, met or not, from the numbers."""

from typing import NamedTuple

import pandas as pd

from experiments.artifacts import SEEDS
from experiments.artifacts_beyond import POLISHED, BeyondArtifacts
from experiments.beyond_even import trained_cpu
from experiments.beyond_tables import title
from sidegan.report.style import NOT_MEASURED
from sidegan.report.tables import spread_if_any

MET, MISSED = "met", "not met"
_VALID, _CONDITION, _SECONDS = 0.99, 300.0, 180.0


class Goal(NamedTuple):
    """A goal, the limit that it sets, the result, and whether it is met."""

    text: str
    limit: str
    result: str
    met: bool


def goals(artifacts: BeyondArtifacts) -> dict[str, list[Goal]]:
    """The goals, by each pool that they are judged for: variants without seeds, and polished ones."""
    alone = [name for name, variant in artifacts.cfg.gan.items() if not variant.seeded]
    return {name: goals_of(artifacts, name) for name in [*alone, POLISHED]}


def goals_of(artifacts: BeyondArtifacts, name: str) -> list[Goal]:
    """The goals for exact physics beside one pool, by the means over trainings."""
    pools = artifacts.pools[artifacts.pools.name == name]
    seeds, cpu = artifacts.pools[artifacts.pools.name == SEEDS], trained_cpu(artifacts, name)
    goals = [
        _goal("valid without filtering", "≥", _VALID, pools.success, ".0%"),
        _goal("median cond(YᵀY)", "≤", _CONDITION, pools.condition, "g"),
        _goal("mean distance", "≥", seeds.distance.mean(), pools.distance, ".3g", ", the seeds'"),
        _goal("effective rank", "≥", seeds["rank"].mean(), pools["rank"], ".3g", ", the seeds'"),
        _goal("training, CPU time of one core [s]", "≤", _SECONDS, cpu, "g"),
    ]
    best, count = artifacts.best, artifacts.cfg.selection.count
    for key, label in (("covariance_norm", "covariance norm"), ("condition", "stacked cond(YᵀY)")):
        for pick in best.pick.unique():
            ours, theirs = (best[(best.pick == pick) & (best.name == one)][key] for one in (name, SEEDS))
            text = f"{label} of the best {count}, {pick} pick"
            goals.append(_goal(text, "<", theirs.mean(), ours, ".4g", ", the seeds'"))
    return goals


def _goal(text: str, sign: str, limit: float, result: pd.Series, form: str, whose: str = "") -> Goal:
    mean = result.mean()
    met = {"≥": mean >= limit, "≤": mean <= limit, "<": mean < limit}[sign]
    return Goal(text, f"{sign} {limit:{form}}{whose}", spread_if_any(result), bool(met))


def table(judged: dict[str, list[Goal]]) -> pd.DataFrame:
    """Goals for people, with two columns for each pool that they are judged for."""
    first = next(iter(judged.values()))
    frame = pd.DataFrame({"goal": [goal.text for goal in first], "wanted": [goal.limit for goal in first]})
    for name, results in judged.items():
        frame[title(name)] = [goal.result for goal in results]
        frame[f"{title(name)}: verdict"] = [_verdict(goal) for goal in results]
    return frame.set_index("goal")


def _verdict(goal: Goal) -> str:
    if goal.result == "—":
        return NOT_MEASURED
    return MET if goal.met else f"**{MISSED}**"
