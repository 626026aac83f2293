"""Ways to make excitation sets, all under the same limits."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial

import numpy as np
import torch
from torch import Tensor

from sidegan.base.storage import read_json
from sidegan.design.greedy import greedy
from sidegan.design.information import information_of
from sidegan.design.optimal import d_optimal
from sidegan.design.prediction import LACKING, Prediction, Volume
from sidegan.design.sequence import Begin, designed, together, told
from sidegan.designer import Designer, begin_designed, one_by_one, variance_of
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.identification import RIGID, TorqueModel
from sidegan.identification.prior import belief
from sidegan.library import Library
from sidegan.library.draw import random_valid
from sidegan.motion.trajectory import Trajectory
from sidegan.plant.varied import torque_scale
from sidegan.seeds.gradient import Gradient
from sidegan.validity import check
from sidegan.worth.orders import Order, SetOf
from sidegan.worth.tasks import legs, states
from sidegan.worth.waypoints import Rests

BY_DESIGNER = ("variance", "prediction")  # makers in whose sets the designer has a part
FROM_FILE = "waypoints"  # the maker whose motions are all in a file
_REACH = 0.9  # of the tightest limit, that random motions and sines use
_TINY = 0.03  # the same of motions that are known to be bad
_TRIES = 2000
_TASK_RATE = 20.0  # [Hz] of the states that tasks are designed for with
_SHRINK, _SHRINKS = 0.9, 5  # of an attempt that was invalid, and how often
_FLAT = 1e-4  # of the samples: how strongly the fit of a sweep avoids large coefficients that cancel
_STEPS = 60  # evaluations per optimised trajectory
_RESERVE = 0.05  # of each limit, as ``excite`` keeps it


def make_set(order: Order) -> SetOf:
    """The set that is ordered.

    Raises:
        ConfigError: when there is no such maker.
        InfeasibleError: when nothing valid is found.
    """
    if order.contender.maker not in MAKERS:
        raise ConfigError(f"worth: {order.contender.maker!r} makes no sets, expected one of {sorted(MAKERS)}")
    return MAKERS[order.contender.maker](order)


def make_sets(orders: Sequence[Order]) -> list[SetOf]:
    """Sets of one contender; those that are designed at once, which takes little longer than one.

    Raises:
        ConfigError: when there is no such maker.
        InfeasibleError: when nothing valid is found.
    """
    one = orders[0].contender
    if one.maker not in DESIGNED or orders[0].option("or", one.period) != one.period:
        return [make_set(order) for order in orders]
    return _at_once(orders)


def _at_once(orders: Sequence[Order]) -> list[SetOf]:
    """Sets of one contender that are designed, all for the same period."""
    first = orders[0]
    problem, aims = first.problem(), [aim_of(one, *DESIGNED[one.contender.maker]) for one in orders]
    generators = [one.generator for one in orders]
    made = together(problem, aims, first.count, first.settings.search, generators, begin=_begin(first))
    return [SetOf(problem.trajectory, c) for c in made]


def _begin(order: Order) -> Begin | None:
    """Where searches for a contender begin: ``prediction``'s where the designer makes the variance small."""
    if order.contender.maker != "prediction":
        return None
    return begin_designed(order.settings.designer, order.settings.begun)


def aim_of(order: Order, kind: type[Prediction], friction: bool = True) -> Prediction:
    """What a designed set is good for; without friction, of rigid bodies alone."""
    settings, body = order.settings, order.constraints.body
    terms = settings.model if friction else replace(RIGID, sign_width=settings.model.sign_width)
    model = TorqueModel(body, terms)
    scale = torch.from_numpy(torque_scale(body, settings.plant.floor))
    generator = torch.Generator().manual_seed(1 + order.generator.initial_seed() % 1000)
    place, rate = order.constraints, 100.0
    moves = [move for one in settings.design_tasks.values() for move in legs(place, one, rate, generator)]
    tasks = states(moves, round(rate / _TASK_RATE))
    return kind(model, tasks, scale, settings.misfits, belief(model, scale, settings.believed))


def exact(order: Order) -> Order:
    """The same order where nothing is lacking in the model: ``prediction`` is variance alone then."""
    sizes = dict.fromkeys(LACKING, 0.0)
    return replace(order, settings=replace(order.settings, misfits=replace(order.settings.misfits, **sizes)))


def _random(order: Order) -> SetOf:
    problem = order.problem()
    draws = random_valid(problem, order.count, order.generator, order.option("reach", _REACH))
    return SetOf(problem.trajectory, draws.coefficients)


def _until_valid(order: Order, draw: Callable[[np.random.Generator, int], Tensor]) -> SetOf:
    """Draws (J, H, 2) by number, each scaled to the limits and then down until it is valid."""
    problem, random = order.problem(), np.random.default_rng(order.seed)
    chosen: list[Tensor] = []
    for _ in range(_TRIES * order.count):
        c = draw(random, len(chosen))[None]
        c = c * (_REACH / problem.limit_use(c))[:, :, None, None] * (c != 0).any(-1, keepdim=True)
        for _ in range(_SHRINKS):
            if bool(check(problem.constraints, problem.trajectory, c).valid.all()):
                chosen.append(c[0])
                break
            c = _SHRINK * c
        if len(chosen) == order.count:
            return SetOf(problem.trajectory, torch.stack(chosen))
    raise InfeasibleError(f"{order.contender.title}: never valid in this workspace")


def _sinusoids(order: Order) -> SetOf:
    """A sine of its own frequency for each joint."""
    joints, harmonics, _ = order.family().shape

    def draw(random: np.random.Generator, number: int) -> Tensor:
        c = torch.zeros(joints, harmonics, 2, dtype=torch.float64)
        which = random.permutation(max(joints, harmonics))[:joints] % harmonics
        phase = random.uniform(0, 2 * np.pi, joints)
        c[range(joints), which] = torch.from_numpy(np.stack([np.cos(phase), np.sin(phase)], 1))
        return c

    return _until_valid(order, draw)


def _chirp(order: Order) -> SetOf:
    """Sweeps of frequency on all joints, with phases of their own; fitted by the harmonics."""
    family = order.family()
    times = family.grid(20 * family.harmonics)
    basis = family.basis(times, 1).flatten(1)
    low, high = order.option("low", 0.1), order.option("high", 0.5)
    sweep = (high - low) / family.period
    angle, rate = (2 * np.pi * x for x in (low * times + sweep * times**2 / 2, low + sweep * times))
    flat = _FLAT * len(times) * torch.eye(basis.shape[1], dtype=torch.float64)

    def draw(random: np.random.Generator, number: int) -> Tensor:
        phase = torch.from_numpy(random.uniform(0, 2 * np.pi, family.joints))
        speed = rate[:, None] * torch.cos(angle[:, None] + phase)
        return torch.linalg.solve(basis.T @ basis + flat, basis.T @ speed).T.reshape(family.shape)

    return _until_valid(order, draw)


def _single(order: Order) -> SetOf:
    """One joint at a time, the others at rest: known to be bad."""
    joints, harmonics, _ = order.family().shape

    def draw(random: np.random.Generator, number: int) -> Tensor:
        c = torch.zeros(joints, harmonics, 2, dtype=torch.float64)
        c[number % joints] = torch.from_numpy(random.standard_normal((harmonics, 2)))
        return c

    return _until_valid(order, draw)


def _tiny(order: Order) -> SetOf:
    """Motions that hardly move: known to be bad."""
    small = replace(order, contender=replace(order.contender, options={"reach": _TINY}))
    return _random(small)


def _conditioned(order: Order) -> SetOf:
    """Each of the smallest condition number."""
    return SetOf(*_of_small_condition(order, order.count))


def _of_small_condition(order: Order, count: int) -> tuple[Trajectory, Tensor]:
    problem = order.problem()
    best = Gradient(_STEPS, 5, _RESERVE).optimise(problem, count, order.seed)
    return problem.trajectory, best.coefficients


def _excite(order: Order) -> SetOf:
    """What ``+experiment=excite`` gives: a D-optimal pick from a pool of optimised trajectories."""
    family, pool = _of_small_condition(order, round(order.option("pool", 4) * order.count))
    information = information_of(order.constraints.body, family, pool)
    return SetOf(family, pool[d_optimal(information, min(order.count, len(pool)))])


def _library(order: Order) -> SetOf:
    """The paper's pick from a random part of a library, of what is valid under these limits.

    Raises:
        ConfigError: when the library is of other trajectories.
    """
    family, library = order.family(), Library.load(order.file, order.constraints.arm)
    found = Trajectory(family.joints, library.coefficients.shape[2], library.period, library.home)
    if found != family:
        raise ConfigError(f"{order.file} has trajectories of {found}, expected {family}")
    random = np.random.default_rng(order.seed)
    part = random.permutation(len(library))[: round(order.option("pool", 10) * order.count)]
    c = library.coefficients[part]
    valid = check(order.constraints, family, c).valid
    diagonals = library.diagonal[part][valid]
    if len(diagonals) < order.count:
        raise InfeasibleError(f"{order.file}: hardly any trajectory is valid under these limits")
    return SetOf(family, c[valid][greedy(diagonals, order.count)])


def _waypoints(order: Order) -> SetOf:
    """Moves through waypoints of a file, from rest to rest: one motion that is repeated.

    Raises:
        ConfigError: when the file holds too few motions, or of another length.
    """
    content = read_json(order.file)
    motions, step = content["trajectories"], float(content["step"])
    if order.number >= len(motions):
        raise ConfigError(f"{order.file} holds {len(motions)} motions, expected {order.number + 1}")
    points = torch.tensor(motions[order.number]["waypoints"], dtype=torch.float64)
    if len(points) - 1 != round(order.contender.period / step):
        raise ConfigError(f"{order.file}: {len(points)} waypoints take no {order.contender.period:g} s")
    return SetOf(Rests(order.contender.period), points.T[None])


def _prediction(order: Order) -> SetOf:
    """Designed for the error on tasks, at the best of its periods."""
    period = order.contender.period
    periods = dict.fromkeys((period, order.option("or", period)))
    problems = [order.problem(one) for one in periods]
    aim = aim_of(order, Prediction)
    search, begin = order.settings.search, _begin(order)
    problem, c = designed(problems, aim, order.count, search, order.generator, begin=begin)
    return SetOf(problem.trajectory, c)


def _variance(order: Order) -> SetOf:
    """Designed by the designer for the variance of torques on tasks alone."""
    settings, problem, aim = order.settings, order.problem(), aim_of(order, Prediction)
    seed = int(torch.randint(2**31, (1,), generator=order.generator))
    designer = Designer(problem.constraints, problem.trajectory, settings.designer, seed=seed)

    def take(c: Tensor) -> None:
        aim.take(told(problem, aim, c[None], problem.samples))

    asked = partial(variance_of, aim, settings.designer.rate)
    return SetOf(problem.trajectory, one_by_one(designer, asked, take, order.count, settings.evaluations))


MAKERS: Mapping[str, Callable[[Order], SetOf]] = {
    "sinusoids": _sinusoids,
    "chirp": _chirp,
    "random": _random,
    "single": _single,
    "tiny": _tiny,
    "condition": _conditioned,
    "excite": _excite,
    "volume": lambda order: _at_once([order])[0],
    "rigid_volume": lambda order: _at_once([order])[0],
    "prediction": _prediction,
    "variance": _variance,
    "library": _library,
    FROM_FILE: _waypoints,
}
# Whose sets are designed one trajectory after another, by what, and whether friction has a part in it.
DESIGNED: Mapping[str, tuple[type[Prediction], bool]] = {
    "volume": (Volume, True),
    "rigid_volume": (Volume, False),
    "prediction": (Prediction, True),
}
