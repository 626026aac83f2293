"""Criteria of the claims about training, diversity and cost (figure 3, the text, the discussion)."""

from collections.abc import Callable

import numpy as np
import pandas as pd

from experiments.artifacts import Group
from experiments.finding import (
    SIDE_GANS,
    Finding,
    against,
    at,
    by_epoch,
    listed,
    ratios,
    unknown,
    words,
)
from experiments.training import EARLY, RELIABLE
from experiments.verdicts import (
    HOLDS,
    NOT,
    TRAINING,
    above,
    below,
    beside,
    interval,
    proportion,
    together,
)
from experiments.words import PAPER
from sidegan.report.style import seconds

_STRUGGLES = 0.4  # valid share that vanilla stays below
_ACCURATE = 0.99  # of the success predictor
_COMPARABLE = 0.85  # of the seeds' distance to the nearest other, and of their effective rank
_MORE = 1.1  # times the seeds' diversity that is significantly more
_FAILS = 0.001  # valid share of density estimates that fail completely
_FEW = 0.2  # valid share that is "about 10 %"
_LATE = 40  # epochs after which the paper compares
_ORDERS = 1e4  # times faster that are four orders of magnitude


def _predictor(group: Group) -> Finding:
    accuracy = group.predictor("accuracy_paper")
    truth = {name: at(group, name, "success", _LATE) for name in SIDE_GANS}
    ours = (
        f"{accuracy.mean():.1%} on held-out seeds and faulty samples; truly valid of what it then accepts: "
    )
    verdict = HOLDS if (accuracy >= _ACCURATE).all() else NOT
    return Finding(verdict, ours + listed(truth, ".0%"), {"accurate": _ACCURATE})


def _reliable(group: Group) -> Finding:
    early = {name: at(group, name, "success", EARLY, EARLY) for name in SIDE_GANS}
    ours = f"{listed(early, '.0%')} valid after {EARLY} epochs"
    verdict = together(above(x, RELIABLE) for x in early.values())
    return Finding(verdict, ours, {"epochs": EARLY, "reliable": RELIABLE})


def _vanilla_fails(group: Group) -> Finding:
    best = by_epoch(group, "vanilla", "success").max()
    return Finding(
        below(best, _STRUGGLES), f"at best {words(interval(best), '.0%')} valid", {"share": _STRUGGLES}
    )


def _vanilla_first(group: Group) -> Finding:
    return _fitter_than(group, {n: -x for n, x in _gains(group, "condition", 1, EARLY).items()}, "worse")


def _fitter(group: Group) -> Finding:
    return _fitter_than(group, _gains(group, "condition", _LATE), "better")


def _fitter_than(group: Group, effects: dict[str, pd.Series], word: str) -> Finding:
    valid = {n: x.dropna() for n, x in _gains(group, "condition_valid", _LATE).items()}
    ours = f"than vanilla: {ratios(effects)} {word}"
    if any(len(x) for x in valid.values()):
        ours += f"; of the valid alone, late: {ratios(valid)} better"
    return Finding(together(above(x) for x in effects.values()), ours, {"epochs": EARLY, "late": _LATE})


def _gains(group: Group, key: str, first: int, last: int | None = None) -> dict[str, pd.Series]:
    """Log ratio of vanilla's metric to each SIDE-GAN's, training by training."""
    vanilla = np.log(at(group, "vanilla", key, first, last))
    return {name: vanilla - np.log(at(group, name, key, first, last)) for name in SIDE_GANS}


def _traded(group: Group) -> Finding:
    lost, gained = {}, {}
    for name in SIDE_GANS:
        lost[name] = at(group, name, "success", EARLY, EARLY) - at(group, name, "success", 30)
        gained[name] = np.log(at(group, name, "condition", EARLY, EARLY)) - np.log(
            at(group, name, "condition", 30)
        )
    verdict = together(together((above(lost[n]), above(gained[n]))) for n in SIDE_GANS)
    ours = f"valid share lost: {listed(lost, '.1%')}; cond(YᵀY) smaller: {ratios(gained)}"
    return Finding(verdict, ours, {"epochs": EARLY})


def _more_diverse(group: Group) -> Finding:
    effects = {n: -x for n, x in _gains(group, "distance", _LATE).items()}
    ours = f"mean distance over vanilla's: {ratios(effects)}; of the valid alone: "
    ours += ratios({n: -x.dropna() for n, x in _gains(group, "distance_valid", _LATE).items()})
    return Finding(together(above(x) for x in effects.values()), ours, {"late": _LATE})


def _comparable(group: Group) -> Finding:
    effects = {
        f"{name}, {key}": against(at(group, name, key, _LATE), group.seeds(key))
        for name in SIDE_GANS
        for key in ("nearest", "rank")
    }
    verdict = together(above(x, np.log(_COMPARABLE)) for x in effects.values())
    distance = {n: against(at(group, n, "distance", _LATE), group.seeds("distance")) for n in SIDE_GANS}
    ours = f"shares of the seeds': {ratios(effects)}; mean distance: {ratios(distance)}"
    return Finding(verdict, ours, {"comparable": _COMPARABLE, "late": _LATE})


def _inertial(group: Group) -> Finding:
    effects = {n: -x for n, x in _gains(group, "distance_diagonal", 1).items()}
    verdicts = [NOT if below(x) == HOLDS else HOLDS for x in effects.values()]
    return Finding(together(verdicts), f"over vanilla's, all epochs: {ratios(effects)}")


def _diverse_diagonals(group: Group) -> Finding:
    seeds = group.seeds("distance_diagonal")
    effects = {n: against(at(group, n, "distance_diagonal", _LATE), seeds) for n in SIDE_GANS}
    verdict = together(above(x, np.log(_MORE)) for x in effects.values())
    return Finding(verdict, f"of the seeds': {ratios(effects)}", {"more": _MORE - 1})


def _diverse_union(group: Group) -> Finding:
    frame, effects = group.frame("generators"), {}
    for name in SIDE_GANS:
        part = frame[frame.name == name].set_index(["column", TRAINING]).union_distance_diagonal
        effects[name] = against(part.astype(float), group.seeds("distance_diagonal"))
    return Finding(together(above(x) for x in effects.values()), f"of the seeds': {ratios(effects)}")


def _density_fails(group: Group) -> Finding:
    share = float(group.first.density.sort_values("bandwidth").success.iloc[-1])
    measured = proportion(share, group.first.cfg.discussion.draws)
    return Finding(beside(measured, _FAILS), f"{words(measured, '.2%')} valid at Scott's bandwidth")


def _few_seeds_fail(group: Group) -> Finding:
    last, smallest = _few(group, "success")
    verdict = together(below(x, _FEW) for x in last.values())
    return Finding(verdict, f"{listed(last, '.0%')} valid", {"seeds": smallest, "few": _FEW})


def _few_seeds_excite(group: Group) -> Finding:
    condition, smallest = _few(group, "condition")
    seeds = group.seeds("condition")
    effects = {n: against(x, seeds) for n, x in condition.items()}
    random = np.log(group.first.random["condition"]) - np.log(seeds.iloc[0])
    ours = f"cond(YᵀY) over the seeds': {ratios(effects)}; random valid ones {np.exp(random):.3g} ×"
    return Finding(together(below(x, random) for x in effects.values()), ours, {"seeds": smallest})


def _few(group: Group, key: str) -> tuple[dict[str, pd.Series], int]:
    """A metric of the kept epoch on the smallest subset of the seeds, by variant, and its size."""
    frame = group.frame("subsets")
    smallest = int(frame.seeds.min())
    part = frame[frame.seeds == smallest]
    kept = part[part.kept].set_index(["column", TRAINING])
    return {n: kept[kept.variant == n][key] for n in SIDE_GANS}, smallest


def _faster(group: Group) -> Finding:
    seed, one = group.first.seed_seconds, group.first.speed["generation_seconds"]
    return _measured(seed / one, _ORDERS, f"{seconds(one)} against {seconds(seed)} ({seed / one:,.0f} ×)")


def _checked(group: Group) -> Finding:
    rate = group.first.speed["valid_per_second"]
    return _measured(rate, 1 / PAPER["seconds"]["checked"], f"{rate:,.3g} /s")


def _grows(group: Group) -> Finding:
    exponent = group.first.speed["growth"]
    return _measured(
        exponent, 3.0, f"cost of an evaluation grows with the {exponent:.2f}th power of its length"
    )


def _measured(value: float, enough: float, text: str) -> Finding:
    if np.isnan(value):
        return unknown()
    return Finding(HOLDS if value > enough else NOT, text)


CRITERIA: dict[str, Callable[[Group], Finding]] = {
    "predictor": _predictor,
    "reliable": _reliable,
    "vanilla_fails": _vanilla_fails,
    "vanilla_first": _vanilla_first,
    "fitter": _fitter,
    "traded": _traded,
    "more_diverse": _more_diverse,
    "comparable": _comparable,
    "inertial": _inertial,
    "diverse_diagonals": _diverse_diagonals,
    "diverse_union": _diverse_union,
    "density_fails": _density_fails,
    "few_seeds_fail": _few_seeds_fail,
    "few_seeds_excite": _few_seeds_excite,
    "faster": _faster,
    "checked": _checked,
    "grows": _grows,
}
