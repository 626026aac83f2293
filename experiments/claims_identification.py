"""Criteria of the claims about identification (tables I, II and III)."""

from collections.abc import Callable
from functools import partial

import numpy as np
import pandas as pd

from experiments import exp1, exp2
from experiments.artifacts import Artifacts
from experiments.pages import PAPER
from experiments.verdicts import (
    GANS,
    REPEAT,
    SIDE_GANS,
    TRAINING,
    Judgement,
    above,
    by_set,
    interval,
    intervals,
    log_ratio,
    not_below,
    of_several,
    ratios,
    together,
    unless_same,
    within,
    words,
)

_COMPARABLE = 1.25  # largest ratio of comparable errors
_NEGLIGIBLE_POINTS = 5.0  # of an improvement [%]: percentage points that are no decrease


def _short_beat_long(made: Artifacts, frame: str) -> Judgement:
    """Whether the seeds' error is below that of every reading of the single long trajectory."""
    nmse = _table1(made, frame)
    cfg = made.cfg
    effects = {
        f"{h} harmonics": log_ratio(nmse[f"long-{h}"], nmse["seeds"]) for h in sorted(cfg.long.harmonics)
    }
    numbers = {
        "fewest": min(cfg.long.harmonics),
        "ratio": max(cfg.long.harmonics) / cfg.trajectory.harmonics,
        "period": cfg.long.period,
        "count": cfg.selection.count,
    }
    ours = f"error of the long trajectory over the seeds': {ratios(effects)}"
    return Judgement.of_each(map(above, effects.values()), ours, numbers)


def _generated_beat_seeds(made: Artifacts, frame: str) -> Judgement:
    """Whether the error of seeds with generated trajectories is below that of the seeds."""
    nmse = _table1(made, frame)
    effects = {n: log_ratio(nmse["seeds"], nmse[n]) for n in SIDE_GANS}
    ours = f"error of the seeds over that of the set: {ratios(effects)}"
    if frame == "errors" and len(made.expected):
        sure = _table1(made, "expected")
        over_all = {n: log_ratio(sure["seeds"], sure[n]) for n in SIDE_GANS}
        ours += f"; expected over all noise: {ratios(over_all)}"
    if frame == "plant":
        weighted = made.plant[made.plant.weighted.astype(bool)]
        others = {"geometric mean over joints": exp1.geometric(made.plant[~made.plant.weighted.astype(bool)])}
        others |= {"weighted per joint": weighted, "both": exp1.geometric(weighted)}
        for name, part in others.items():
            logs = exp1.over_others(part, made.cfg.gan)
            ours += f"; {name}: {ratios({n: logs[n] for n in SIDE_GANS})}"
    return Judgement.of_each(map(above, effects.values()), ours, {"count": made.cfg.selection.count})


def _generated_alone(made: Artifacts) -> Judgement:
    """Whether random sets of generated trajectories have less expected error than those of seeds."""
    frame = made.draws[made.draws.noise == "error"]
    effects, geometric = ({n: _of_draws(frame, n, key) for n in SIDE_GANS} for key in ("nmse", "geometric"))
    ours = f"error of the seeds over that of the set: {ratios(effects)}; geometric mean: {ratios(geometric)}"
    return Judgement.of_each(map(above, effects.values()), ours, {"count": made.cfg.selection.count})


def _of_draws(frame: pd.DataFrame, name: str, key: str) -> pd.Series:
    """Log ratio of the seeds' mean expected error of random draws to a set's, by training."""
    error = np.log(frame[frame["set"] == name].groupby(TRAINING)[key].mean())
    return np.log(frame[frame["set"] == "seeds"][key].mean()) - error


def _improve(made: Artifacts, which: Callable[[list[int]], int]) -> Judgement:
    """Whether every variant improves on the seeds measured least or most often."""
    gains = {n: _gain(made, n, which) for n in GANS}
    most = max(made.cfg.replication.replicas)
    parts = (f"{name} {words(interval(x).turned(exp2.percent))}" for name, x in gains.items())
    ours = f"[%, geometric mean over joints] {'; '.join(parts)}"
    return Judgement.of_each(map(above, gains.values()), ours, {"most": most})


def _more_than_vanilla(made: Artifacts) -> Judgement:
    vanilla = _gain(made, "vanilla", min)
    gains = {n: _gain(made, n, min) - vanilla for n in SIDE_GANS}
    return Judgement.of_each(map(above, gains.values()), f"error of vanilla over that of {ratios(gains)}")


def _eigen_best(made: Artifacts) -> Judgement:
    more = _gain(made, "eigen", min) - _gain(made, "diagonal", min)
    return Judgement(above(more), f"error of diagonal over that of {ratios({'eigen': more})}")


def _either(made: Artifacts) -> Judgement:
    """Whether eigen and diagonal lead to comparable errors."""
    sure = _table1(made, "expected")
    effects = {
        "table I, expected": log_ratio(sure["diagonal"], sure["eigen"]),
        "table II": _gain(made, "eigen", min) - _gain(made, "diagonal", min),
    }
    parts = (within(x, np.log(_COMPARABLE)) for x in effects.values())
    ours = f"error of diagonal over that of eigen: {ratios(effects)}"
    return Judgement.of_each(parts, ours, {"comparable": _COMPARABLE - 1})


def _not_less(made: Artifacts) -> Judgement:
    """Whether every variant's improvement [%] is as large over the seeds measured most as least often.

    In ratios of errors, the generated set's error would cancel: they are the same for every variant.
    """
    replicas = made.cfg.replication.replicas
    most, least = ({n: _gain(made, n, which, "improvement") for n in GANS} for which in (max, min))
    effects = {n: most[n] - least[n] for n in GANS}
    geometric = {
        n: _gain(made, n, max).map(exp2.percent) - _gain(made, n, min).map(exp2.percent) for n in GANS
    }
    verdicts, others = (
        [not_below(x, negligible=_NEGLIGIBLE_POINTS) for x in of.values()] for of in (effects, geometric)
    )
    ours = f"change of the improvement [percentage points]: mean over joints {intervals(effects)}"
    ours += f"; geometric mean {intervals(geometric)}" + unless_same(together(verdicts), together(others))
    numbers = {"negligible": _NEGLIGIBLE_POINTS, "least": min(replicas), "most": max(replicas)}
    return Judgement.of_each(verdicts, ours, numbers)


def _smallest_norm(made: Artifacts) -> Judgement:
    """Whether eigen's covariance norm is below that of every other set of Table III."""
    facts = made.whole_facts
    per_sample = facts.assign(covariance_norm=facts.covariance_norm * facts.samples)
    effects = _over_eigen(made, facts)
    otherwise = together(map(above, _over_eigen(made, per_sample).values()))
    ours = f"norm relative to eigen's: {ratios(effects)}; verdict on ‖diag P‖ × samples: {otherwise}"
    return Judgement.of_each(map(above, effects.values()), ours)


def _over_eigen(made: Artifacts, frame: pd.DataFrame) -> dict[str, pd.Series]:
    """Log ratios of covariance norms to eigen's, by set of the paper's table."""
    norms = by_set(frame, "covariance_norm", made.cfg.gan)
    others = [name for name in norms if name in PAPER["table3"] and name != "eigen"]
    return {name: log_ratio(norms[name], norms["eigen"]) for name in others}


def _table1(made: Artifacts, frame: str) -> dict[str, pd.Series]:
    """Unweighted nMSE of experiment 1, mean over joints, by set."""
    raw = getattr(made, frame)
    return by_set(raw[~raw.weighted.astype(bool)], "nmse", made.cfg.gan)


def _gain(made: Artifacts, name: str, which: Callable[[list[int]], int], key: str = "gain") -> pd.Series:
    """Unweighted log ratio of the error of the seeds, measured least or most often, to that of a variant.

    Mean over joints, by training and noise draw. With key ``improvement``: in per cent, as in Table II.
    """
    errors = made.whole_errors
    replicas = which(made.cfg.replication.replicas)
    part = exp2.improvement(errors[~errors.weighted], name, f"seeds ×{replicas}")
    return of_several(part.groupby([TRAINING, REPEAT])[key].mean())


CRITERIA: dict[str, Callable[[Artifacts], Judgement]] = {
    "short_beat_long": partial(_short_beat_long, frame="errors"),
    "generated_beat_seeds": partial(_generated_beat_seeds, frame="errors"),
    "generated_alone": _generated_alone,
    "real_short_beat_long": partial(_short_beat_long, frame="plant"),
    "real_generated_beat_seeds": partial(_generated_beat_seeds, frame="plant"),
    "generated_improve": partial(_improve, which=min),
    "more_than_vanilla": _more_than_vanilla,
    "either": _either,
    "eigen_best": _eigen_best,
    "not_replaced": partial(_improve, which=max),
    "not_less": _not_less,
    "smallest_norm": _smallest_norm,
}
