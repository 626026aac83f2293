"""Criteria of the claims about identification (tables I, II and III)."""

from collections.abc import Callable, Mapping
from functools import partial
from typing import TypeAlias

import pandas as pd

from experiments import exp2
from experiments.artifacts import Group
from experiments.finding import GANS, SIDE_GANS, Finding, listed, ratios
from experiments.verdicts import REPEAT, SEED_SET, TRAINING, above, by_set, log_ratio, not_below, together
from sidegan.pipeline.settings import Config

OfWholeSets: TypeAlias = Callable[[pd.DataFrame, Config], Finding]

_LEVELS = [SEED_SET, TRAINING, REPEAT]


def _short_beat_long(group: Group) -> Finding:
    return _against_long(group, "errors")


def _real_short_beat_long(group: Group) -> Finding:
    return _against_long(group, "plant")


def _against_long(group: Group, frame: str) -> Finding:
    """Whether the seeds' error is below that of every reading of the single long trajectory."""
    nmse, cfg = _table1(group, frame), group.first.cfg
    names = [f"long-{h}" for h in sorted(cfg.long.harmonics)]
    effects = {f"{n.removeprefix('long-')} harmonics": log_ratio(nmse[n], nmse["seeds"]) for n in names}
    ratio = max(cfg.long.harmonics) / cfg.trajectory.harmonics
    numbers = {"fewest": min(cfg.long.harmonics), "ratio": ratio, "period": cfg.long.period}
    ours = f"error of the long one over the seeds': {ratios(effects)}"
    verdict = together(above(x) for x in effects.values())
    return Finding(verdict, ours, numbers | {"count": cfg.selection.count})


def _generated_beat_seeds(group: Group) -> Finding:
    return _against_seeds(group, "errors")


def _real_generated_beat_seeds(group: Group) -> Finding:
    return _against_seeds(group, "plant")


def _against_seeds(group: Group, frame: str) -> Finding:
    nmse = _table1(group, frame)
    effects = {n: log_ratio(nmse["seeds"], nmse[n]) for n in SIDE_GANS}
    ours = f"error of the seeds over theirs: {ratios(effects)}"
    if frame == "errors" and len(group.frame("expected")):
        sure = _table1(group, "expected")
        over_all = {n: log_ratio(sure["seeds"], sure[n]) for n in SIDE_GANS}
        ours += f"; expected over all noise: {ratios(over_all)}"
    numbers = {"count": group.first.cfg.selection.count}
    return Finding(together(above(x) for x in effects.values()), ours, numbers)


def _of_whole_sets(criterion: OfWholeSets, group: Group) -> Finding:
    """A claim about Table II."""
    return criterion(group.frame("whole_errors"), group.first.cfg)


def _generated_improve(errors: pd.DataFrame, config: Config) -> Finding:
    first = min(config.replication.replicas)
    gains = {n: gain(errors, n, first) for n in GANS}
    return Finding(together(above(x) for x in gains.values()), f"[%] {listed(gains)}")


def _more_than_vanilla(errors: pd.DataFrame, config: Config) -> Finding:
    first = min(config.replication.replicas)
    vanilla = gain(errors, "vanilla", first)
    gains = {n: gain(errors, n, first) - vanilla for n in SIDE_GANS}
    return Finding(together(above(x) for x in gains.values()), f"[percentage points] {listed(gains)}")


def _eigen_best(errors: pd.DataFrame, config: Config) -> Finding:
    first = min(config.replication.replicas)
    more = gain(errors, "eigen", first) - gain(errors, "diagonal", first)
    return Finding(above(more), f"[percentage points over diagonal] {listed({'eigen': more})}")


def _not_replaced(errors: pd.DataFrame, config: Config) -> Finding:
    most = max(config.replication.replicas)
    gains = {n: gain(errors, n, most) for n in GANS}
    return Finding(together(above(x) for x in gains.values()), f"[%] {listed(gains)}", {"most": most})


def _not_less(errors: pd.DataFrame, config: Config) -> Finding:
    replicas = config.replication.replicas
    change = {n: gain(errors, n, max(replicas)) - gain(errors, n, min(replicas)) for n in GANS}
    verdict = together(map(not_below, change.values()))
    return Finding(verdict, f"[percentage points, ×{max(replicas)} − ×{min(replicas)}] {listed(change)}")


def _smallest_norm(group: Group) -> Finding:
    """Whether eigen's covariance norm is below that of every other set of Table III."""
    facts = group.frame("whole_facts")
    per_sample = facts.assign(covariance_norm=facts.covariance_norm * facts.samples)
    effects, otherwise = _over_eigen(group, facts), _smallest(_over_eigen(group, per_sample))
    ours = f"theirs over eigen's: {ratios(effects)}; verdict on ‖diag P‖ × samples: {otherwise}"
    return Finding(_smallest(effects), ours)


def _smallest(effects: Mapping[str, pd.Series]) -> str:
    return together(above(x) for x in effects.values())


def _over_eigen(group: Group, frame: pd.DataFrame) -> dict[str, pd.Series]:
    """Logarithms of the ratios of covariance norms to eigen's, by set of the paper's table."""
    norms = by_set(frame, "covariance_norm", group.first.cfg.gan)
    return {n: log_ratio(x, norms["eigen"]) for n, x in norms.items() if n not in ("eigen", _most(group))}


def _most(group: Group) -> str:
    """The seeds measured so often that the paper's table does not have them."""
    return f"seeds ×{max(group.first.cfg.replication.replicas)}"


def _table1(group: Group, frame: str) -> dict[str, pd.Series]:
    """Unweighted nMSE of experiment 1, mean over joints, by set."""
    raw = group.frame(frame)
    return by_set(raw[~raw.weighted.astype(bool)], "nmse", group.first.cfg.gan)


def gain(errors: pd.DataFrame, name: str, replicas: int) -> pd.Series:
    """Unweighted improvement [%] over the seeds measured so often, mean over joints."""
    part = exp2.improvement(errors[~errors.weighted], name, f"seeds ×{replicas}")
    return part.groupby(_LEVELS).improvement.mean()


# Claims about Table II, of the errors that whole sets leave.
OF_WHOLE_SETS: dict[str, OfWholeSets] = {
    "generated_improve": _generated_improve,
    "more_than_vanilla": _more_than_vanilla,
    "eigen_best": _eigen_best,
    "not_replaced": _not_replaced,
    "not_less": _not_less,
}

CRITERIA: dict[str, Callable[[Group], Finding]] = {
    "short_beat_long": _short_beat_long,
    "generated_beat_seeds": _generated_beat_seeds,
    "real_short_beat_long": _real_short_beat_long,
    "real_generated_beat_seeds": _real_generated_beat_seeds,
    **{key: partial(_of_whole_sets, criterion) for key, criterion in OF_WHOLE_SETS.items()},
    "smallest_norm": _smallest_norm,
}
