"""The goals for exact physics, met or not, from the numbers."""

from typing import NamedTuple

import pandas as pd

from experiments.artifacts import SEEDS
from experiments.artifacts_beyond import POLISHED, BeyondArtifacts
from experiments.beyond_frames import mean_of, trained_cpu
from experiments.beyond_tables import spread, title

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
    alone = [name for name in artifacts.cfg.gan if not artifacts.needs(name)[0]]
    return {name: goals_of(artifacts, name) for name in [*alone, POLISHED]}


def goals_of(artifacts: BeyondArtifacts, name: str) -> list[Goal]:
    """The goals for exact physics beside one pool, by the means over trainings."""
    pools, cpu = artifacts.pools[artifacts.pools.name == name], trained_cpu(artifacts, name)
    seeds = mean_of(artifacts.pools, SEEDS)
    goals = [
        _goal("valid without filtering", f"≥ {_VALID:.0%}", pools.success, pools.success.mean() >= _VALID),
        _goal("median cond(YᵀY)", f"≤ {_CONDITION:g}", pools.condition, pools.condition.mean() <= _CONDITION),
        *(
            _goal(label, f"≥ {seeds[key]:.3g}, the seeds'", pools[key], pools[key].mean() >= seeds[key])
            for key, label in (("distance", "mean distance"), ("rank", "effective rank"))
        ),
        _goal("training, CPU time of one core [s]", f"≤ {_SECONDS:g}", cpu, cpu.mean() <= _SECONDS),
    ]
    best, count = artifacts.best, artifacts.cfg.selection.count
    for key, label in (("covariance_norm", "covariance norm"), ("condition", "stacked cond(YᵀY)")):
        for pick in best.pick.unique():
            part = best[best.pick == pick]
            ours, theirs = part[part.name == name][key], float(part[part.name == SEEDS][key].mean())
            text = f"{label} of the best {count}, {pick} pick"
            goals.append(_goal(text, f"< {theirs:.4g}, the seeds'", ours, ours.mean() < theirs))
    return goals


def _goal(text: str, limit: str, result: pd.Series, met: bool) -> Goal:
    return Goal(text, limit, spread(result), bool(met))


def table(judged: dict[str, list[Goal]]) -> pd.DataFrame:
    """Goals for people, with two columns for each pool that they are judged for."""
    first = next(iter(judged.values()))
    frame = pd.DataFrame({"goal": [goal.text for goal in first], "wanted": [goal.limit for goal in first]})
    for name, results in judged.items():
        frame[title(name)] = [goal.result for goal in results]
        frame[f"{title(name)}: verdict"] = [MET if goal.met else f"**{MISSED}**" for goal in results]
    return frame.set_index("goal")
