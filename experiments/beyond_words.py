"""Numbers that the sentences of the page on exact physics name."""

from collections.abc import Mapping
from operator import gt, itemgetter, lt
from typing import Any

import numpy as np
import pandas as pd

from experiments.artifacts import RANDOM, SEEDS
from experiments.artifacts_beyond import OPTIMAL, OPTIMISED, SCRATCH, TRANSFER, BeyondArtifacts
from experiments.beyond_even import optimiser_seconds, trained_cpu, worth_from
from experiments.beyond_tables import arrival, called, final_condition, title
from experiments.words import COLUMNS

Measures = dict[str, float]

_CROWDED = 1.2  # wall time over CPU time, from which on the page says so
_LOWER, _HIGHER = COLUMNS["lower_is_better"], COLUMNS["higher_is_better"]
_INFORMATIVE = ("condition", "stack", "covariance_norm", "nmse_weighted")


def summary(artifacts: BeyondArtifacts) -> dict[str, Measures]:
    """All measures of every pool: means over trainings, sets by the D-optimal pick."""
    best = artifacts.best[artifacts.best.pick == OPTIMAL].rename(columns={"condition": "stack"})
    times = artifacts.first_times[["name", "total", "each"]]
    means = [frame.groupby("name").mean(numeric_only=True) for frame in (best, artifacts.pools, times)]
    names = artifacts.pools.name.unique()
    return {name: {str(k): float(x) for one in means for k, x in one.loc[name].items()} for name in names}


def facts(artifacts: BeyondArtifacts) -> dict[str, Any]:
    """Numbers about the run and the single sections; those of parts that were not run are left out."""
    cfg = artifacts.cfg
    variants = cfg.gan | cfg.beyond.objectives
    terms = {name: x.exact.terms.values() for name, x in variants.items() if x.exact is not None}
    source = cfg.gan[artifacts.source]
    numbers = {
        "compared": min(cfg.scale.evaluation, cfg.seeds.count, cfg.library.count),
        "crowding": _crowding(artifacts.first_times),
        "together": {name: max((term.together for term in x), default=1) for name, x in terms.items()},
        "source_steps": source.epochs * (source.steps or 1),
    }
    parts = {"polish": _polish, "objectives": _objectives, "few": _few}
    return numbers | {
        name: words(artifacts) for name, words in parts.items() if len(getattr(artifacts, name))
    }


def _crowding(times: pd.DataFrame) -> float | None:
    """Wall time over CPU time of trainings, where that is measured and much."""
    ratio = float((times.wall / times.cpu).mean())
    return ratio if ratio >= _CROWDED else None


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


def choices(artifacts: BeyondArtifacts, summary: Mapping[str, Measures]) -> dict[str, Any]:
    """Numbers that say for whom each way is the right choice.

    Returns:
        source, quickest (the way to a first set, chance left aside; None where no time was measured),
        optimiser_is_quickest, slower (the source than that); each (one more trajectory by the source, and
        one of the same condition number by the optimiser [s]), training of the source [s], worth
        (trajectories from which on it pays, or None), condition of both; informative (the two best ways by
        each measure); elsewhere (of each target, steps to the same quality by transfer and from scratch,
        last valid share); measures and wins (those in which another way is better).
    """
    source = artifacts.source
    totals = {n: x["total"] for n, x in summary.items() if n != RANDOM and not np.isnan(x["total"])}
    quickest = min(totals, key=totals.__getitem__, default=None)
    first = totals[quickest] if quickest else np.nan
    ours = summary[source]
    alike = optimiser_seconds(artifacts.polish, ours["condition"])
    training = trained_cpu(artifacts, source).mean()
    worth = worth_from(training, ours["each"], alike)
    return {
        "source": source,
        "quickest": quickest,
        "first": first,
        "optimiser_is_quickest": quickest in (SEEDS, OPTIMISED),
        "slower": ours["total"] / first,
        "each": (ours["each"], alike),
        "training": training,
        "worth": None if worth == np.inf else worth,
        "condition": ours["condition"],
        "informative": {_LOWER[key]: _two_best(summary, key) for key in _INFORMATIVE},
        "elsewhere": _elsewhere(artifacts.transfers),
        "measures": len(_LOWER) + len(_HIGHER),
        "wins": {name: _wins(x, ours) for name, x in summary.items() if name not in (source, RANDOM)},
    }


def _two_best(summary: Mapping[str, Measures], key: str) -> list[tuple[str, float]]:
    values = {name: measures[key] for name, measures in summary.items()}
    return sorted(values.items(), key=itemgetter(1))[:2]


def _elsewhere(frame: pd.DataFrame) -> list[tuple[str, float, float, float]]:
    rows = []
    for target, part in frame.groupby("target", sort=False) if len(frame) else []:
        transfer, scratch = (part[part.way == way] for way in (TRANSFER, SCRATCH))
        ours, theirs = (arrival(curve, final_condition(part))[0] for curve in (transfer, scratch))
        rows.append((called(str(target)), ours, theirs, float(transfer.success.iloc[-1])))
    return rows


def _wins(theirs: Measures, ours: Measures) -> list[str]:
    """Measures in which another way is better."""
    signs = ((_LOWER, lt), (_HIGHER, gt))
    return [label for labels, less in signs for k, label in labels.items() if less(theirs[k], ours[k])]
