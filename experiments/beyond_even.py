"""From how many trajectories on a generator pays, compared at equal condition number."""

import numpy as np
import pandas as pd

from experiments.artifacts import RANDOM
from experiments.artifacts_beyond import BeyondArtifacts


def break_even(artifacts: BeyondArtifacts) -> pd.DataFrame:
    """A row per number of gradient steps on generated trajectories.

    Columns: steps; condition, the median that they reach; ours and theirs, CPU time [s] of a proven
    trajectory from the generator, and by the optimiser from random points to the same median; more, the
    number from which on the generator has paid for its training, infinite where it never does.
    """
    source = artifacts.source
    curve = artifacts.polish[artifacts.polish.start == source].sort_values("steps")
    training, each = trained_cpu(artifacts, source).mean(), _each(artifacts)
    proof = max(0.0, each - float(curve.seconds.iloc[0]))  # which the curve does not have
    rows = []
    for steps, condition, seconds in curve[["steps", "condition", "seconds"]].itertuples(index=False):
        ours, theirs = seconds + proof, optimiser_seconds(artifacts.polish, condition)
        more = worth_from(training, ours, theirs)
        rows.append({"steps": steps, "condition": condition, "ours": ours, "theirs": theirs, "more": more})
    return pd.DataFrame(rows)


def optimiser_seconds(polish: pd.DataFrame, condition: float) -> float:
    """CPU time [s] of a proven trajectory by the optimiser from random points, of a median condition number.

    Between two of its numbers of steps on the logarithms' line; at most that of its best, at least that of
    its fewest steps. Not a number where the curve was not made.
    """
    theirs = polish[polish.start == RANDOM] if len(polish) else polish
    theirs = theirs.dropna(subset=["condition", "seconds"]) if len(theirs) else theirs
    if theirs.empty:
        return float("nan")
    some = theirs.sort_values("condition")
    return float(np.exp(np.interp(np.log(condition), np.log(some.condition), np.log(some.seconds))))


def worth_from(training: float, ours: float, theirs: float) -> float:
    """Trajectories from which on a training [s] has paid for itself; infinite where it never does."""
    gain = theirs - ours
    if np.isnan(gain):
        return float("nan")
    return training / gain if gain > 0 else float("inf")


def trained_cpu(artifacts: BeyondArtifacts, name: str) -> pd.Series:
    """CPU time of a variant's trainings [s] where all have one: what ran beside them does not count."""
    ours = artifacts.first_times[artifacts.first_times.name == name]
    return ours.cpu if ours.cpu.notna().all() else ours.training_seconds


def _each(artifacts: BeyondArtifacts) -> float:
    """CPU time of one more valid trajectory, drawn and proven [s]."""
    times = artifacts.first_times
    return float(times[times.name == artifacts.source]["each"].mean())
