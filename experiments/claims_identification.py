"""Criteria of the claims about identification (tables I, II and III)."""

from collections.abc import Callable, Iterable
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
    log_over,
    log_ratio,
    not_below,
    of_several,
    ratios,
    together,
    unless_same,
    within,
    words,
)
from sidegan.pipeline.stages.baselines import GRADIENT
from sidegan.pipeline.stages.selection import RANDOM

_COMPARABLE = 1.25  # largest ratio of comparable errors
_NEGLIGIBLE_POINTS = 5.0  # of an improvement [%]: percentage points that are no decrease


def _short_beat_long(made: Artifacts, frame: str) -> Judgement:
    """Whether the seeds' error is below that of every reading of the single long trajectory."""
    nmse = _table1(made, frame)
    cfg = made.cfg
    effects = _over_long(made, frame, ["seeds"])
    numbers = {"fewest": min(cfg.long.harmonics), "period": cfg.long.period, "count": cfg.selection.count}
    ours = f"error of the long trajectory over the seeds': {ratios(effects)}"
    if GRADIENT in nmse:
        ours += f"; over that of short ones by gradients: {ratios(_over_long(made, frame, [GRADIENT]))}"
    return Judgement.of_each(map(above, effects.values()), ours, numbers)


def _side_gan_beats_long(made: Artifacts) -> Judgement:
    """Whether the error with either SIDE-GAN is below that of every reading of the single long trajectory."""
    effects = _over_long(made, "errors", SIDE_GANS)
    ours = f"error of the long trajectory over that of the set: {ratios(effects)}"
    return Judgement.of_each(map(above, effects.values()), ours, {"count": made.cfg.selection.count})


def _over_long(made: Artifacts, frame: str, sets: Iterable[str]) -> dict[str, pd.Series]:
    """Log ratio of the error of each reading of the long trajectory to each set's."""
    nmse = _table1(made, frame)
    return {
        f"{h} harmonics, {name}": log_ratio(nmse[f"long-{h}"], nmse[name])
        for h in sorted(made.cfg.long.harmonics)
        for name in sets
    }


def _generated_beat_seeds(made: Artifacts) -> Judgement:
    """Whether the expected error of seeds with generated trajectories is below that of the seeds."""
    effects, drawn = (_over_set(_table1(made, frame)) for frame in ("expected", "errors"))
    ours = f"error of the seeds over that of the set: {ratios(effects)}; by noise draws: {ratios(drawn)}"
    for name, part in _by_other_means(made.expected).items():
        ours += f"; {name}: {ratios(_over_set(by_set(part, 'nmse', made.cfg.gan)))}"
    return Judgement.of_each(map(above, effects.values()), ours, {"count": made.cfg.selection.count})


def _real_generated_beat_seeds(made: Artifacts) -> Judgement:
    """Whether the error on plants of seeds with generated trajectories is below that of the seeds."""
    effects = _over_set(_table1(made, "plant"))
    ours = f"error of the seeds over that of the set: {ratios(effects)}"
    for name, part in _by_other_means(made.plant).items():
        logs = exp1.over_others(part, made.cfg.gan)
        ours += f"; {name}: {ratios({n: logs[n] for n in SIDE_GANS})}"
    return Judgement.of_each(map(above, effects.values()), ours, {"count": made.cfg.selection.count})


def _by_other_means(errors: pd.DataFrame) -> dict[str, pd.DataFrame]:
    """The same errors with joints weighted alike, by geometric means and by their noise."""
    is_weighted = errors.weighted.astype(bool)
    unweighted, weighted = errors[~is_weighted], errors[is_weighted]
    means = {"geometric mean over joints": exp1.geometric(unweighted), "weighted per joint": weighted}
    return means | {"both": exp1.geometric(weighted)}


def _over_set(nmse: dict[str, pd.Series]) -> dict[str, pd.Series]:
    """Log ratio of the seeds' error to each SIDE-GAN's."""
    return {n: log_ratio(nmse["seeds"], nmse[n]) for n in SIDE_GANS}


def _generated_alone(made: Artifacts) -> Judgement:
    """Whether the best generated trajectories alone have less expected error than the best of the seeds."""
    best = by_set(made.alone[~made.alone.weighted.astype(bool)], "nmse", [f"{n}-alone" for n in made.cfg.gan])
    seeds = _table1(made, "expected")["seeds"]
    effects = {n: log_ratio(seeds, best[f"{n}-alone"]) for n in SIDE_GANS}
    frame = made.draws[made.draws.noise == "error"]
    drawn, geometric = ({n: _of_draws(frame, n, key) for n in SIDE_GANS} for key in ("nmse", "geometric"))
    ours = f"error of the seeds over that of the set: {ratios(effects)}; of random draws from both: "
    ours += f"{ratios(drawn)}, geometric mean {ratios(geometric)}"
    return Judgement.of_each(map(above, effects.values()), ours, {"count": made.cfg.selection.count})


def _of_draws(frame: pd.DataFrame, name: str, key: str) -> pd.Series:
    """Log ratio of the seeds' mean expected error of random draws to a set's, by training."""
    error = np.log(frame[frame["set"] == name].groupby(TRAINING)[key].mean())
    return np.log(frame[frame["set"] == "seeds"][key].mean()) - error


def _improve(made: Artifacts, which: Callable[[list[int]], int]) -> Judgement:
    """Whether every variant improves on the seeds measured least or most often, and more than random ones."""
    gains = {n: _gain(made, n, which) for n in exp2.added(made.cfg)}
    over_random = {n: log_over(gains[n], gains[RANDOM]) for n in GANS}
    most = max(made.cfg.replication.replicas)
    parts = (f"{name} {words(interval(x).turned(exp2.percent))}" for name, x in gains.items())
    ours = f"[%, geometric mean over joints] {'; '.join(parts)}; error with random valid ones over that of "
    ours += ratios(over_random)
    verdicts = [above(x) for x in (*(gains[n] for n in GANS), *over_random.values())]
    return Judgement.of_each(verdicts, ours, {"most": most})


def _more_than_vanilla(made: Artifacts) -> Judgement:
    vanilla = _gain(made, "vanilla", min)
    gains = {n: _gain(made, n, min) - vanilla for n in SIDE_GANS}
    return Judgement.of_each(map(above, gains.values()), f"error of vanilla over that of {ratios(gains)}")


def _eigen_best(made: Artifacts) -> Judgement:
    more = _gain(made, "eigen", min) - _gain(made, "diagonal", min)
    return Judgement(above(more), f"error of diagonal over that of {ratios({'eigen': more})}")


def _either(made: Artifacts) -> Judgement:
    """Whether eigen and diagonal lead to comparable errors."""
    expected = _table1(made, "expected")
    effects = {
        "table I, expected": log_ratio(expected["diagonal"], expected["eigen"]),
        "table II": _gain(made, "eigen", min) - _gain(made, "diagonal", min),
    }
    parts = (within(x, np.log(_COMPARABLE)) for x in effects.values())
    ours = f"error of diagonal over that of eigen: {ratios(effects)}"
    return Judgement.of_each(parts, ours, {"comparable": _COMPARABLE - 1})


def _not_less(made: Artifacts) -> Judgement:
    """Whether the variants' mean improvement [%] is as large over the seeds measured most as least often.

    In ratios of errors, the generated set's error would cancel: they are the same for every variant.
    """
    replicas = made.cfg.replication.replicas
    most, least = ({n: _gain(made, n, which, "improvement") for n in GANS} for which in (max, min))
    effects = {n: most[n] - least[n] for n in GANS}
    geometric = {
        n: _gain(made, n, max).map(exp2.percent) - _gain(made, n, min).map(exp2.percent) for n in GANS
    }
    changes = [pd.concat(of, axis=1).mean(axis=1) for of in (effects, geometric)]
    verdict, other = (not_below(x, negligible=_NEGLIGIBLE_POINTS) for x in changes)
    ours = f"change of the improvement [percentage points]: mean over joints {intervals(effects)}"
    ours += f"; geometric mean {intervals(geometric)}" + unless_same(verdict, other)
    numbers = {"negligible": _NEGLIGIBLE_POINTS, "least": min(replicas), "most": max(replicas)}
    return Judgement(verdict, ours, numbers)


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
    "side_gan_beats_long": _side_gan_beats_long,
    "generated_beat_seeds": _generated_beat_seeds,
    "generated_alone": _generated_alone,
    "real_short_beat_long": partial(_short_beat_long, frame="plant"),
    "real_generated_beat_seeds": _real_generated_beat_seeds,
    "generated_improve": partial(_improve, which=min),
    "more_than_vanilla": _more_than_vanilla,
    "either": _either,
    "eigen_best": _eigen_best,
    "not_replaced": partial(_improve, which=max),
    "not_less": _not_less,
    "smallest_norm": _smallest_norm,
}
