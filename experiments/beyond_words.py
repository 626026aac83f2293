"""Numbers that the sentences of the page on exact physics name."""

from operator import itemgetter
from typing import Any

import numpy as np
import pandas as pd

from experiments.artifacts import RANDOM, SEEDS
from experiments.artifacts_beyond import OPTIMAL, OPTIMISED, SCRATCH, TRANSFER, BeyondArtifacts
from experiments.beyond_frames import GOOD, NEAR, Measures, arrival, final_condition, first_times, trained_cpu
from experiments.beyond_tables import called, title

_CROWDED = 1.2  # wall time over CPU time, from which on the page says so
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
_INFORMATIVE = ("condition", "stack", "covariance_norm", "nmse_weighted")


def facts(artifacts: BeyondArtifacts) -> dict[str, Any]:
    """Numbers about the run and the single sections; those of parts that were not run are left out."""
    cfg = artifacts.cfg
    variants = cfg.gan | cfg.beyond.objectives
    terms = {name: x.exact.terms.values() for name, x in variants.items() if x.exact is not None}
    source = cfg.gan[artifacts.source]
    numbers = {
        "good": GOOD,
        "near": NEAR - 1,
        "compared": min(cfg.scale.evaluation, cfg.seeds.count, cfg.library.count),
        "crowding": _crowding(artifacts),
        "together": {name: max((term.together for term in x), default=1) for name, x in terms.items()},
        "source_steps": source.epochs * (source.steps or 1),
        "targets": _targets(artifacts),
    }
    parts = {"polish": _polish, "objectives": _objectives, "few": _few}
    return numbers | {
        name: words(artifacts) for name, words in parts.items() if len(getattr(artifacts, name))
    }


def _crowding(artifacts: BeyondArtifacts) -> float | None:
    """Wall time over CPU time of trainings, where that is known and much."""
    measured = first_times(artifacts).dropna(subset=["cpu"])
    ratio = float((measured.wall / measured.cpu).mean()) if len(measured) else 1.0
    return ratio if ratio >= _CROWDED else None


def _targets(artifacts: BeyondArtifacts) -> list[str]:
    """What is special about each target for transfer."""
    words = []
    for name, target in artifacts.cfg.beyond.targets.items():
        words += [f"{called(name)}: {target.payload:g} kg"] if target.payload else []
        words += [f"{called(name)}: {target.desk:g} m"] if target.desk is not None else []
    return words


def _polish(artifacts: BeyondArtifacts) -> dict[str, Any]:
    """The best point from generated trajectories, the first from random starts as good, and their best."""
    points = artifacts.polish.dropna(subset=["condition"]).sort_values("seconds")
    ours, theirs = (points[points.start == name] for name in (artifacts.cfg.beyond.source, RANDOM))
    if ours.empty or theirs.empty:
        return {}
    there = theirs[theirs.condition <= ours.condition.min()]
    best = ours.sort_values("condition").iloc[0]
    return {"best": best, "there": there.head(1).to_dict("records"), "random": theirs.condition.min()}


def _objectives(artifacts: BeyondArtifacts) -> dict[str, Any]:
    """Steps of the trainings; the best objective at each of three things, by D-optimal pick."""
    both = (artifacts.best, artifacts.objectives)
    best, part = (frame[frame.pick == OPTIMAL].set_index("name") for frame in both)
    others = best.groupby("name").log_det.mean()
    winners = {
        "smallest stacked condition number": part.condition.idxmin(),
        "largest log determinant": part.log_det.idxmax(),
        "smallest covariance norm": part.covariance_norm.idxmin(),
    }
    return {
        "steps": sorted({x.epochs * (x.steps or 1) for x in artifacts.cfg.beyond.objectives.values()}),
        "winners": {what: str(name).removeprefix("exact_") for what, name in winners.items()},
        "largest": part.log_det.max(),
        "other": (title(str(others.idxmax())), others.max()),
    }


def _few(artifacts: BeyondArtifacts) -> dict[str, list[int]]:
    """Numbers of seeds that each variant was trained on."""
    frame = artifacts.few.sort_values("seeds")
    return {str(n): sorted(part.seeds.unique()) for n, part in frame.groupby("variant", sort=False)}


def choices(artifacts: BeyondArtifacts, summary: dict[str, Measures]) -> dict[str, Any]:
    """Numbers that say for whom each way is the right choice.

    Returns:
        source, quickest (the way to a first set, chance left aside), optimiser_is_quickest, slower (the
        source than that); each (one more trajectory by the source and by the optimiser [s]), training of the
        source [s], worth (trajectories from which on it pays, or None), conditions of both; informative (the
        two best ways by each measure); elsewhere (of each target, steps to the same quality by transfer and
        from scratch, last valid share); measures and wins (those in which another way is better).
    """
    source = artifacts.source
    quickest = min((name for name in summary if name != RANDOM), key=lambda name: summary[name]["total"])
    ours, optimised = summary[source], summary[OPTIMISED]
    training, gain = trained_cpu(artifacts, source).mean(), optimised["each"] - ours["each"]
    return {
        "source": source,
        "quickest": quickest,
        "first": summary[quickest]["total"],
        "optimiser_is_quickest": quickest in (SEEDS, OPTIMISED),
        "slower": ours["total"] / summary[quickest]["total"],
        "each": (ours["each"], optimised["each"]),
        "training": training,
        "worth": training / gain if gain > 0 else None,
        "conditions": (ours["condition"], optimised["condition"]),
        "informative": {_LOWER[key]: _two_best(summary, key) for key in _INFORMATIVE},
        "elsewhere": _elsewhere(artifacts.transfers),
        "measures": len(_LOWER) + len(_HIGHER),
        "wins": {name: _wins(x, ours) for name, x in summary.items() if name not in (source, RANDOM)},
    }


def _two_best(summary: dict[str, Measures], key: str) -> list[tuple[str, float]]:
    values = {name: measures[key] for name, measures in summary.items()}
    return sorted(values.items(), key=itemgetter(1))[:2]


def _elsewhere(frame: pd.DataFrame) -> list[tuple[str, float, float, float]]:
    rows = []
    for target, part in frame.groupby("target", sort=False) if len(frame) else []:
        final = final_condition(part)
        curves = {str(way): curve for way, curve in part.groupby("way", sort=False)}
        steps = {way: arrival(curve, final)[0] for way, curve in curves.items()}
        transfer, scratch = (steps.get(way, np.nan) for way in (TRANSFER, SCRATCH))
        end = float(curves[TRANSFER].success.iloc[-1])
        rows.append((called(str(target)), transfer, scratch, end))
    return rows


def _wins(theirs: Measures, ours: Measures) -> list[str]:
    lower = [label for key, label in _LOWER.items() if theirs[key] < ours[key]]
    return lower + [label for key, label in _HIGHER.items() if theirs[key] > ours[key]]
