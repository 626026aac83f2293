"""Criteria of the claims about training, diversity and cost (figure 3, the text, the discussion)."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from functools import partial
from math import expm1

import numpy as np
import pandas as pd
from scipy.linalg import qr
from scipy.special import logit
from scipy.stats import kendalltau

from experiments import generality
from experiments.artifacts import Artifacts
from experiments.pages import PAPER
from experiments.training import EARLY, LATE, RELIABLE
from experiments.verdicts import (
    GANS,
    HOLDS,
    NOT,
    SIDE_GANS,
    TRAINING,
    UNKNOWN,
    Judgement,
    above,
    at,
    below,
    by_epoch,
    intervals,
    lies_below,
    log_odds,
    not_below,
    proportion,
    ratios,
    shares,
    together,
    unless_same,
    words,
)
from sidegan.base.arrays import Array
from sidegan.base.names import plain
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import SEEDS

_STRUGGLES = 0.4  # valid share that vanilla stays below
_ACCURATE = 0.99  # least accuracy of the success predictor
_COMPARABLE = 0.85  # least share of the seeds' coverage, or mean distance
_COLLAPSED = 0.5  # share of the seeds' coverage below which modes are lost
_MORE = 1.1  # ratio to the seeds' diversity that is a notable increase
_INDIFFERENT = 0.01  # negligible spread of a ratio
_CARRIED = 0.1  # valid share on another arm above which trajectories carry over
_FAILS = 0.001  # largest valid share of a density estimate that fails completely
_FEW = 0.2  # valid share that is "about 10 %"
_TRADING = 30  # epoch from which variants trade validity for fitness
_ORDERS, _VALID = 1e4, 1e2  # least speed-up of a generated trajectory, and of one found valid


def _predictor(made: Artifacts) -> Judgement:
    told = made.surrogates
    numbers = {"accurate": _ACCURATE}
    if told["rejected"] is None:
        return Judgement(UNKNOWN, "the vanilla GAN made no faulty sample to reject", numbers)
    late = {name: _odds(made, at(made, name, "success", LATE)) for name in SIDE_GANS}
    ours = f"accepts {told['accepted']:.1%} of held-out seeds and rejects {told['rejected']:.1%} of faulty "
    sizes = [key for key in told if key.startswith("accepted_")]
    smaller = (f"{key.partition('_')[2]} % of their size {told[key]:.1%}" for key in sizes)
    ours += f"samples; accepts of the seeds' motions at {', '.join(smaller)}"
    ours += "; valid share of all samples of the generators"
    ours += f" that it taught, from epoch {LATE} on: {shares(late)}"
    parts = [HOLDS if told[key] >= _ACCURATE else NOT for key in ("accepted", "rejected")]
    return Judgement.of_each(parts, ours, numbers)


def _reliable(made: Artifacts) -> Judgement:
    early = {name: _odds(made, at(made, name, "success", EARLY, EARLY)) for name in SIDE_GANS}
    ours = f"{shares(early)} valid after {EARLY} epochs"
    parts = (above(x, logit(RELIABLE)) for x in early.values())
    return Judgement.of_each(parts, ours, {"epochs": EARLY, "reliable": RELIABLE})


def _vanilla_fails(made: Artifacts) -> Judgement:
    curve = by_epoch(made, "vanilla", "success")
    best, end = (_odds(made, x) for x in (curve.max(), curve.iloc[-1]))
    texts = [shares({"vanilla": x}) for x in (best, end)]
    epochs = ", ".join(str(epoch) for epoch in sorted(set(curve.idxmax())))
    ours = f"at best {texts[0]} valid (after epoch {epochs}), at the end {texts[1]}"
    return Judgement(below(best, logit(_STRUGGLES)), ours, {"share": _STRUGGLES})


def _odds(made: Artifacts, success: pd.Series) -> pd.Series:
    """Log odds of valid shares of generators."""
    return log_odds(success, made.cfg.evaluation)


def _against_vanilla(
    made: Artifacts, key: str, judge: Callable[[pd.Series], str], first: int, last: int | None = None
) -> Judgement:
    """Vanilla's metric over the SIDE-GANs' in the same epochs; also of means and of valid samples alone."""
    effects = _gains(made, key, first, last)
    parts = list(map(judge, effects.values()))
    ours = f"vanilla's over the SIDE-GANs': all samples {ratios(effects)}"
    for other, label in ((f"{key}_mean", "means over samples"), (f"{key}_valid", "valid samples alone")):
        if other in made.histories:
            beside = {n: x.dropna() for n, x in _gains(made, other, first, last).items()}
            verdict = together(map(judge, beside.values()))
            ours += f"; {label} {ratios(beside)}" + unless_same(together(parts), verdict)
    return Judgement.of_each(parts, ours, {"epochs": EARLY, "late": LATE})


def _gains(made: Artifacts, key: str, first: int, last: int | None = None) -> dict[str, pd.Series]:
    """Log ratio of vanilla's metric to each SIDE-GAN's, by training."""
    vanilla = np.log(at(made, "vanilla", key, first, last))
    return {name: vanilla - np.log(at(made, name, key, first, last)) for name in SIDE_GANS}


def _traded(made: Artifacts) -> Judgement:
    early = {n: _odds(made, at(made, n, "success", EARLY, EARLY)) for n in SIDE_GANS}
    late = {n: _odds(made, at(made, n, "success", _TRADING)) for n in SIDE_GANS}
    lost = {n: above(early[n] - late[n]) for n in SIDE_GANS}

    def smaller(name: str, key: str) -> pd.Series:
        """Log ratio of a metric early on to its present value."""
        return np.log(at(made, name, key, EARLY, EARLY)) - np.log(at(made, name, key, _TRADING))

    kinds = {
        "condition": "all samples",
        "condition_mean": "means over samples",
        "condition_valid": "valid samples alone",
    }
    ours = f"valid after {EARLY} epochs {shares(early)}, later {shares(late)}; cond(YᵀY) early over late"
    parts: list[str] = []
    for key, label in kinds.items():
        gained = {n: smaller(n, key).dropna() for n in SIDE_GANS}
        verdicts = [verdict for n in SIDE_GANS for verdict in (lost[n], above(gained[n]))]
        parts = parts or verdicts  # that decide the claim
        ours += f"; {label} {ratios(gained)}" + unless_same(together(parts), together(verdicts))
    return Judgement.of_each(parts, ours, {"epochs": EARLY})


def _comparable(made: Artifacts) -> Judgement:
    covered = {
        f"{name}, {label}": x
        for label, key in (("c", "coverage"), ("log diag(YᵀY)", "coverage_diagonal"))
        for name, x in _covered(made, key, SIDE_GANS).items()
    }
    of_seeds = made.as_many_seeds
    kept = {
        f"{name}, {key}": np.log(at(made, name, key, LATE) / of_seeds[key])
        for name in SIDE_GANS
        for key in ("distance", "rank_uncentred")
    }
    cosines = {name: at(made, name, "cosine", LATE) for name in SIDE_GANS}
    ours = f"coverage relative to the seeds': {ratios(covered)}; {ratios(kept)}; "
    ours += f"mean cosine: {intervals(cosines)}"
    alike = (above(x, np.log(_COMPARABLE)) for x in covered.values())
    return Judgement.of_each(alike, ours, {"comparable": _COMPARABLE})


def _covered(made: Artifacts, key: str, names: Iterable[str]) -> dict[str, pd.Series]:
    """Log ratio of each generator's coverage of half of the seeds to that by the other half, by training.

    One that covers no seed counts as if it covered half of one.
    """
    of_set = made.generators.set_index(TRAINING).astype({key: float}).groupby("name")[key]
    others, least = of_set.get_group(SEEDS).mean(), 1 / made.cfg.seeds.count
    return {name: np.log(of_set.get_group(name).clip(least) / others) for name in names}


def _no_collapse(made: Artifacts) -> Judgement:
    covered = _covered(made, "coverage", GANS)
    of_seeds = made.as_many_seeds["rank_uncentred"]
    ranks = {name: np.log(at(made, name, "rank_uncentred", LATE) / of_seeds) for name in GANS}
    cosines = {name: at(made, name, "cosine", LATE) for name in GANS}
    ours = f"coverage relative to the seeds': {ratios(covered)}; directions: {ratios(ranks)}; "
    ours += f"mean cosine: {intervals(cosines)}"
    parts = (above(x, np.log(_COLLAPSED)) for x in (*covered.values(), *ranks.values()))
    return Judgement.of_each(parts, ours, {"collapsed": _COLLAPSED})


def _inertial(made: Artifacts) -> Judgement:
    effects = {n: -x for n, x in _gains(made, "distance_diagonal", 1).items()}
    ours = f"relative to vanilla, all epochs: {ratios(effects)}"
    return Judgement.of_each(map(not_below, effects.values()), ours)


def _diverse_diagonals(made: Artifacts) -> Judgement:
    seeds = made.seeds["distance_diagonal"]
    effects = {n: np.log(at(made, n, "distance_diagonal", LATE) / seeds) for n in SIDE_GANS}
    parts = (above(x, np.log(_MORE)) for x in effects.values())
    return Judgement.of_each(parts, f"relative to the seeds: {ratios(effects)}", {"more": _MORE - 1})


def _diverse_union(made: Artifacts) -> Judgement:
    frame = made.generators
    effects = {}
    for name in SIDE_GANS:
        part = frame[frame.name == name].set_index(TRAINING).union_distance_diagonal
        effects[name] = np.log(part.astype(float) / made.seeds["distance_diagonal"])
    return Judgement.of_each(map(above, effects.values()), f"relative to the seeds: {ratios(effects)}")


def _trace(made: Artifacts) -> Judgement:
    """Whether the trace of YᵀY keeps the order of the seeds in another basis of their parameters."""
    run = made.run
    cell = made.run.cell
    grams = gram(cell.body, cell.trajectory, run.load(seed_set(run)).coefficients)
    turned, chosen = other_bases(cell.body)
    kept = {}
    for name, change in (("a rotation", turned), ("another choice of base parameters", chosen)):
        other = change.mT @ grams @ change
        before, after = (np.log(np.trace(x, axis1=1, axis2=2)) for x in (grams, other))
        kept[name] = float((after - before).std(ddof=1)), kendalltau(before, after).statistic
    text = "{}: spread of the ratio {:.2g}, Kendall's τ of their order {:.3g}"
    ours = "; ".join(text.format(name, expm1(x), tau) for name, (x, tau) in kept.items())
    parts = [HOLDS if x < _INDIFFERENT else NOT for x, _ in kept.values()]
    return Judgement.of_each(parts, ours, {"indifferent": _INDIFFERENT})


def other_bases(body: RigidBody) -> tuple[Array, Array]:
    """Changes of the base parameters, (p, p) each, Y′ = Y · change: a rotation; other independent columns."""
    mapping = body.base.mapping
    count = body.parameters_count
    random = np.random.default_rng(0)
    turned = np.linalg.qr(random.standard_normal((count, count)))[0]
    _, _, order = qr(mapping, mode="economic", pivoting=True)
    return turned, mapping[:, order[:count]]


def _other_arms(made: Artifacts) -> Judgement:
    """Whether the same recipe works on other arms, by the page on generality."""
    arms = generality.of_arms(made.run)
    needed = {"reliable": RELIABLE, "comparable": _COMPARABLE}
    if arms is None or "eigen" not in arms.index.unique("generator"):
        return Judgement(UNKNOWN, UNKNOWN, needed)
    others = arms.xs("eigen", level="generator").drop(made.run.cell.arm.name, errors="ignore")
    parts, texts = list[str](), list[str]()
    for name, row in others.iterrows():
        valid, distance, error = row[[generality.VALID, *generality.JUDGED]]
        kept = valid >= RELIABLE, distance >= _COMPARABLE, error <= 1
        parts += [HOLDS if passed else NOT for passed in kept]
        texts.append(f"{name} {valid:.3g} valid, distance {distance:.3g}, error {error:.3g} times the seeds'")
    return Judgement.of_each(parts, "; ".join(texts), needed)


def _no_transfer(made: Artifacts) -> Judgement:
    """Whether trajectories of an arm are hardly ever valid on another, by the page on generality."""
    shares_of = generality.of_others(made.run)
    needed = {"carried": _CARRIED}
    if shares_of is None:
        return Judgement(UNKNOWN, UNKNOWN, needed)
    ours = f"at most {shares_of.max():.1%} of an arm's trajectories are valid on another"
    return Judgement(HOLDS if shares_of.max() < _CARRIED else NOT, ours, needed)


def _density_fails(made: Artifacts) -> Judgement:
    share = float(made.density.sort_values("bandwidth").success.iloc[-1])
    measured = proportion(share, made.cfg.discussion.draws)
    return Judgement(lies_below(measured, _FAILS), f"{words(measured, '.2%')} valid at Scott's bandwidth")


def _few_seeds_fail(made: Artifacts) -> Judgement:
    kept, smallest = _few(made, "success")
    odds = {n: _odds(made, x) for n, x in kept.items()}
    parts = (below(x, logit(_FEW)) for x in odds.values())
    return Judgement.of_each(parts, f"{shares(odds)} valid", {"seeds": smallest, "few": _FEW})


def _few_seeds_excite(made: Artifacts) -> Judgement:
    condition, smallest = _few(made, "condition")
    effects = {n: np.log(x / made.random["condition"]) for n, x in condition.items()}
    seeds = {n: np.log(x / made.seeds["condition"]) for n, x in condition.items()}
    ours = f"cond(YᵀY) relative to random valid: {ratios(effects)}; to the seeds: {ratios(seeds)}"
    return Judgement.of_each(map(below, effects.values()), ours, {"seeds": smallest})


def _few(made: Artifacts, key: str) -> tuple[dict[str, pd.Series], int]:
    """A metric after the last epoch on the smallest subset of the seeds, by variant; the subset's size.

    Without training on subsets there are no variants, and the size is the paper's.
    """
    if not made.cfg.discussion.sizes:
        return {}, PAPER["few_seeds"]
    frame = made.subsets
    smallest = int(frame.seeds.min())
    part = frame[frame.seeds == smallest]
    kept = part[part.kept].set_index(TRAINING)
    return {n: kept[kept.variant == n][key] for n in SIDE_GANS}, smallest


def _faster(made: Artifacts) -> Judgement:
    seed = made.seed_seconds
    new = made.speed["generation_seconds"]
    return _measured(seed / new, _ORDERS, f"{seconds(new)} against {seconds(seed)} ({seed / new:,.0f} ×)")


def _trained_too(made: Artifacts) -> Judgement:
    """Whether a valid generated trajectory takes far less time than a seed; with its training beside."""
    seed, new = made.seed_seconds, made.valid_seconds
    count = made.cfg.library.count
    spent = made.training_seconds("eigen", made.cfg.trainings[0]) / count
    text = f"{seconds(new)} with the check, against {seconds(seed)} ({seed / new:,.0f} ×); {seconds(spent)} "
    text += f"for each of {count} with surrogates, training and library ({seed / spent:,.0f} ×)"
    return _measured(seed / new, _VALID, text)


def _few_seeds_faster(made: Artifacts) -> Judgement:
    """Whether a valid trajectory of a generator trained on few seeds takes less time than a seed."""
    valid, smallest = _few(made, "success")
    kept = made.histories[made.histories.kept & (made.histories.variant == "eigen")].success.mean()
    drawn = kept / made.speed["valid_per_second"]  # time to draw and check a trajectory
    seed = made.seed_seconds
    each = {name: drawn / float(x.mean()) for name, x in valid.items()}
    ours = "; ".join(f"{name} {seconds(x)}" for name, x in each.items()) + f" against {seconds(seed)}"
    found = _measured(seed / max(each.values(), default=np.nan), 1.0, ours)
    return replace(found, numbers={"seeds": smallest})


def _checked(made: Artifacts) -> Judgement:
    rate = made.speed["valid_per_second"]
    return _measured(rate, 1 / PAPER["seconds"]["checked"], f"{plain(rate)} /s")


def _grows(made: Artifacts) -> Judgement:
    exponent = made.speed["growth"]
    text = f"cost of an evaluation grows with the {exponent:.2f}th power of its length"
    return _measured(exponent, 3.0, text)


def _measured(value: float, enough: float, text: str) -> Judgement:
    """Judgement of a single number; unknown if it was not measured."""
    if np.isnan(value):
        return Judgement(UNKNOWN, UNKNOWN)
    return Judgement(HOLDS if value > enough else NOT, text)


def seconds(duration: float) -> str:
    """A duration in a natural unit: ``1.4 ms``, ``6 min``, ``14 h``."""
    units = {"h": 3600.0, "min": 60.0, "s": 1.0, "ms": 1e-3, "µs": 1e-6}
    unit = next((unit for unit, size in units.items() if duration >= size), "µs")
    return f"{plain(duration / units[unit])} {unit}"


CRITERIA: dict[str, Callable[[Artifacts], Judgement]] = {
    "predictor": _predictor,
    "reliable": _reliable,
    "vanilla_fails": _vanilla_fails,
    "vanilla_first": partial(_against_vanilla, key="condition", judge=below, first=1, last=EARLY),
    "fitter": partial(_against_vanilla, key="condition", judge=above, first=LATE),
    "traded": _traded,
    "more_diverse": partial(_against_vanilla, key="distance", judge=below, first=LATE),
    "comparable": _comparable,
    "no_collapse": _no_collapse,
    "inertial": _inertial,
    "diverse_diagonals": _diverse_diagonals,
    "diverse_union": _diverse_union,
    "density_fails": _density_fails,
    "trace": _trace,
    "other_arms": _other_arms,
    "no_transfer": _no_transfer,
    "few_seeds_fail": _few_seeds_fail,
    "few_seeds_excite": _few_seeds_excite,
    "few_seeds_faster": _few_seeds_faster,
    "faster": _faster,
    "trained_too": _trained_too,
    "checked": _checked,
    "grows": _grows,
}
