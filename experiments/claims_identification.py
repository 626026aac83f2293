"""Criteria of the claims about identification (tables I, II and III)."""

from collections.abc import Callable, Mapping
from functools import partial

import pandas as pd

from experiments import exp2
from experiments.artifacts import Group
from experiments.finding import GANS, SIDE_GANS, Judgement, listed, ratios
from experiments.verdicts import REPEAT, SEED_SET, TRAINING, above, by_set, log_ratio, not_below, together

_LEVELS = [SEED_SET, TRAINING, REPEAT]


def _short_beat_long(group: Group, frame: str) -> Judgement:
    """Whether the seeds' error is below that of every reading of the single long trajectory."""
    nmse, cfg = _table1(group, frame), group.first.cfg
    effects = {
        f"{h} harmonics": log_ratio(nmse[f"long-{h}"], nmse["seeds"]) for h in sorted(cfg.long.harmonics)
    }
    numbers = {
        "fewest": min(cfg.long.harmonics),
        "ratio": max(cfg.long.harmonics) / cfg.trajectory.harmonics,
        "period": cfg.long.period,
        "count": cfg.selection.count,
    }
    return Judgement(
        _all_above(effects), f"error of the long one over the seeds': {ratios(effects)}", numbers
    )


def _generated_beat_seeds(group: Group, frame: str) -> Judgement:
    """Whether the error of seeds and generated ones is below that of the seeds."""
    nmse = _table1(group, frame)
    effects = {n: log_ratio(nmse["seeds"], nmse[n]) for n in SIDE_GANS}
    ours = f"error of the seeds over theirs: {ratios(effects)}"
    if frame == "errors" and len(group.frame("expected")):
        sure = _table1(group, "expected")
        over_all = {n: log_ratio(sure["seeds"], sure[n]) for n in SIDE_GANS}
        ours += f"; expected over all noise: {ratios(over_all)}"
    return Judgement(_all_above(effects), ours, {"count": group.first.cfg.selection.count})


def _generated_improve(group: Group) -> Judgement:
    gains = {n: _gain(group, n, min) for n in GANS}
    return Judgement(_all_above(gains), f"[%] {listed(gains)}")


def _more_than_vanilla(group: Group) -> Judgement:
    vanilla = _gain(group, "vanilla", min)
    gains = {n: _gain(group, n, min) - vanilla for n in SIDE_GANS}
    return Judgement(_all_above(gains), f"[percentage points] {listed(gains)}")


def _eigen_best(group: Group) -> Judgement:
    more = _gain(group, "eigen", min) - _gain(group, "diagonal", min)
    return Judgement(above(more), f"[percentage points over diagonal] {listed({'eigen': more})}")


def _not_replaced(group: Group) -> Judgement:
    gains = {n: _gain(group, n, max) for n in GANS}
    most = max(group.first.cfg.replication.replicas)
    return Judgement(_all_above(gains), f"[%] {listed(gains)}", {"most": most})


def _not_less(group: Group) -> Judgement:
    replicas = group.first.cfg.replication.replicas
    change = {n: _gain(group, n, max) - _gain(group, n, min) for n in GANS}
    verdict = together(map(not_below, change.values()))
    return Judgement(verdict, f"[percentage points, ×{max(replicas)} − ×{min(replicas)}] {listed(change)}")


def _smallest_norm(group: Group) -> Judgement:
    """Whether eigen's covariance norm is below that of every other set of Table III."""
    facts = group.frame("whole_facts")
    per_sample = facts.assign(covariance_norm=facts.covariance_norm * facts.samples)
    effects, otherwise = _over_eigen(group, facts), _all_above(_over_eigen(group, per_sample))
    ours = f"theirs over eigen's: {ratios(effects)}; verdict on ‖diag P‖ × samples: {otherwise}"
    return Judgement(_all_above(effects), ours)


def _over_eigen(group: Group, frame: pd.DataFrame) -> dict[str, pd.Series]:
    """Logarithms of the ratios of covariance norms to eigen's, by set of the paper's table."""
    norms = by_set(frame, "covariance_norm", group.first.cfg.gan)
    most = f"seeds ×{max(group.first.cfg.replication.replicas)}"  # which the paper's table does not have
    return {n: log_ratio(x, norms["eigen"]) for n, x in norms.items() if n not in ("eigen", most)}


def _all_above(effects: Mapping[str, pd.Series]) -> str:
    return together(above(x) for x in effects.values())


def _table1(group: Group, frame: str) -> dict[str, pd.Series]:
    """Unweighted nMSE of experiment 1, mean over joints, by set."""
    raw = group.frame(frame)
    return by_set(raw[~raw.weighted.astype(bool)], "nmse", group.first.cfg.gan)


def _gain(group: Group, name: str, which: Callable[[list[int]], int]) -> pd.Series:
    """Unweighted improvement [%] over the seeds measured least or most often, mean over joints."""
    errors, replicas = group.frame("whole_errors"), which(group.first.cfg.replication.replicas)
    part = exp2.improvement(errors[~errors.weighted], name, f"seeds ×{replicas}")
    return part.groupby(_LEVELS).improvement.mean()


CRITERIA: dict[str, Callable[[Group], Judgement]] = {
    "short_beat_long": partial(_short_beat_long, frame="errors"),
    "generated_beat_seeds": partial(_generated_beat_seeds, frame="errors"),
    "real_short_beat_long": partial(_short_beat_long, frame="plant"),
    "real_generated_beat_seeds": partial(_generated_beat_seeds, frame="plant"),
    "generated_improve": _generated_improve,
    "more_than_vanilla": _more_than_vanilla,
    "eigen_best": _eigen_best,
    "not_replaced": _not_replaced,
    "not_less": _not_less,
    "smallest_norm": _smallest_norm,
}
