"""Frames of the page on exact physics that follow from several artifacts: time from nothing."""

from typing import Any

import numpy as np
import pandas as pd

from experiments.artifacts import SEEDS
from experiments.artifacts_beyond import OPTIMAL, OPTIMISED, POLISHED, SCRATCH, BeyondArtifacts, elapsed

Measures = dict[str, float]
GOOD, NEAR = (
    0.97,
    1.1,
)  # valid share and factor of the final condition number that count as "the same quality"


def first_times(artifacts: BeyondArtifacts) -> pd.DataFrame:
    """Seconds to the first set of every way, by part: seeds, surrogates, training_seconds, drawing, total.

    Further columns: each, CPU time of one more valid trajectory; cpu, that of a training, where it was
    measured, which is then what counts; and wall, what was recorded of the training.
    """
    count, source = artifacts.cfg.selection.count, artifacts.source
    rows: list[dict[str, Any]] = []
    for measured in artifacts.first_sets.to_dict("records"):
        name, training = measured["name"], measured["training"]
        row = {"name": name, "training": training, "drawing": measured["seconds"], "each": measured["each"]}
        if name == SEEDS:
            row["each"] = artifacts.seeds["cpu_seconds"] / artifacts.seeds["count"]
        if name in artifacts.cfg.gan:
            row |= _training_times(artifacts, name, training, measured["training_seconds"])
        rows.append(row)
        if name == source:
            each = artifacts.polished_each(training)
            rows.append(row | {"name": POLISHED, "each": each, "drawing": each * count})
    each = artifacts.optimised_each
    rows.append({"name": OPTIMISED, "training": 0, "drawing": each * count, "each": each})
    frame = pd.DataFrame(rows)
    parts = ["seeds", "surrogates", "training_seconds", "drawing"]
    return frame.assign(total=frame[parts].fillna(0.0).sum(axis=1))


def _training_times(artifacts: BeyondArtifacts, name: str, training: int, cpu: float) -> dict[str, float]:
    """Times before and of a training [s]: CPU time where it was measured, wall time elsewhere."""
    seeded, surrogates = artifacts.needs(name)
    wall = artifacts.training_wall(name, training)
    return {
        "cpu": cpu,
        "seeds": artifacts.seeds_seconds if seeded else 0.0,
        "surrogates": artifacts.surrogates_seconds if surrogates else 0.0,
        "wall": wall,
        "training_seconds": wall if np.isnan(cpu) else cpu,
    }


def trained_cpu(artifacts: BeyondArtifacts, name: str) -> pd.Series:
    """CPU time of a variant's trainings [s] where all have one: what ran beside them does not count."""
    first = first_times(artifacts)
    ours = first[first.name == name]
    return ours.cpu if ours.cpu.notna().all() else ours.training_seconds


def summary(artifacts: BeyondArtifacts) -> dict[str, Measures]:
    """All measures of every pool: means over trainings, sets by the D-optimal pick."""
    best = artifacts.best[artifacts.best.pick == OPTIMAL].rename(columns={"condition": "stack"})
    first = first_times(artifacts)[["name", "total", "each"]]
    names = artifacts.pool_names
    frames = (best, artifacts.pools, first)
    return {name: {k: x for frame in frames for k, x in mean_of(frame, name).items()} for name in names}


def mean_of(frame: pd.DataFrame, name: str) -> Measures:
    """Mean of every column over the trainings of one pool."""
    part = frame[frame.name == name].select_dtypes(np.number)
    return {str(key): float(x) for key, x in part.mean().items()}


def progress(artifacts: BeyondArtifacts) -> pd.DataFrame:
    """Metrics of all trainings after every epoch, against the seconds since nothing was there."""
    parts, histories = [], artifacts.histories
    for row in first_times(artifacts).to_dict("records"):
        history = histories[(histories.variant == row["name"]) & (histories.training == row["training"])]
        if len(history):
            since = row["seeds"] + row["surrogates"]
            each = artifacts.epoch_seconds(row["name"], row["training"])
            at = since + elapsed(len(history), row["training_seconds"], each)
            parts.append(history.assign(seconds=at))
    return pd.concat(parts, ignore_index=True)


def arrival(curve: pd.DataFrame, final: float) -> tuple[float, float]:
    """Steps and seconds after which a training first has the quality; NaN when it never has.

    Args:
        curve: rows of one training.
        final: median condition number at the end of the training from scratch.
    """
    good = curve[(curve.success >= GOOD) & (curve.condition <= NEAR * final)]
    return (np.nan, np.nan) if good.empty else (float(good.steps.min()), float(good.seconds.min()))


def final_condition(part: pd.DataFrame) -> float:
    """Median condition number at the end of the training from scratch for one target."""
    return float(part[part.way == SCRATCH].condition.iloc[-1])
