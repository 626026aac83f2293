"""Bounds over a cell are true bounds, and the smallest margins are those of dense samples."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.base.arrays import Array
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER, Arm
from sidegan.validity import Constraints, Plane, check
from sidegan.validity.capsules import piece_distances, place_points, reaches
from sidegan.validity.constraints import CONSTRAINTS
from tests.chains import constrained, driven, random_chain, random_states
from tests.oracle import chain_model

from .critical import BALL, BLOCK, BOX, DESK, HULL, filled, limited, margins_of, moderate, only, smallest

CHAINS = [0, 1, 2, 3, 5, 9]  # joints; 0: the LWR
ROUNDING = 1e-9
_STEP = 1e-5  # [rad or m] of differences


@pytest.fixture
def chain(request: pytest.FixtureRequest, arm: Arm) -> Arm:
    """A random chain, or the LWR; in the longest chain slides reach far, and mostly downwards."""
    chain = random_chain(request.param, 0)[0] if request.param else arm
    if chain.joints < 9:
        return chain
    lower, upper = -chain.position_upper, -chain.position_lower
    return replace(chain, translation=0.1 * chain.translation, position_lower=lower, position_upper=upper)


def bounds(arm: Arm, *rates: Array) -> np.ndarray:
    """Bounds of torques' rates and second derivatives, (2, N, J), of an arm and its rates, (N, J) each."""
    from sidegan.kernels import cells
    from sidegan.validity.search import model_of

    model = model_of(Constraints(replace(arm, capsules=only(arm.capsules, np.arange(0)))))
    speed, acceleration, jerk, snap = (np.abs(x) for x in rates)
    drifts, nothing = np.stack([snap, snap]), (np.zeros((1, 1, 1)), np.zeros((1, 5, 1)), np.zeros(1))
    motions = cells.Motions(nothing[0], jerk, drifts, nothing[1], nothing[2], 0.1)
    found, sums = np.zeros((2, *speed.shape)), np.zeros((2, arm.joints, 3))
    for n, (v, a) in enumerate(zip(speed, acceleration)):
        motion, bent = np.stack([0 * v, 0 * v, v, a]), np.zeros((2, arm.joints))
        cells.bend_torques(model, motion, motions, n, sums, bent)
        found[:, n] = bent
    return found


def rates_of(arm: Arm, *states: Array) -> np.ndarray:
    """Rates of the torques, (N, J), of positions and three derivatives (N, J), by Pinocchio's slopes."""
    model, rates = chain_model(arm), []
    data = model.createData()
    for q, *rest in zip(*states):
        slopes = pin.computeRNEADerivatives(model, data, q, *rest[:2])
        rates.append(sum(slope @ rate for slope, rate in zip(slopes, rest)))
    return np.array(rates)


def shifted(states: Sequence[Array], time: Array) -> list[Array]:
    """Positions and three derivatives after times (N, 1) [s], given four."""
    return [sum(x * time**k / math.factorial(k) for k, x in enumerate(states[order:])) for order in range(4)]


@pytest.mark.parametrize("chain", CHAINS, indirect=True)
def test_torque_rates_stay_within_their_bounds(chain: Arm) -> None:
    """From gravity alone to inertia alone."""
    q, dq, ddq = random_states(chain, 300, chain.joints)
    size = np.logspace(-2, 2, 300)[:, None]
    generator = np.random.default_rng(chain.joints)
    higher = generator.standard_normal((2, *ddq.shape)) * size**2
    states = (q, dq * size, ddq * size[::-1], *higher)
    step = 1e-5 / np.maximum(size, 1.0)
    up, down = (rates_of(chain, *shifted(states, s * step)) for s in (1, -1))
    most, bend = bounds(chain, *states[1:])
    assert (np.abs(rates_of(chain, *states[:4])) <= most * (1 + ROUNDING)).all()
    assert (np.abs(up - down) / (2 * step) <= bend * (1 + 1e-4) + 1e-4).all()


@pytest.mark.parametrize("chain", CHAINS, indirect=True)
def test_capsule_points_move_no_faster_than_their_reach(chain: Arm) -> None:
    q = random_states(chain, 200)[0].T
    capsules = chain.capsules
    each = np.arange(len(capsules.link))
    _, _, reach = reaches(chain, np.zeros((0, 2), int), np.stack([each, each], 1))
    ends, links = np.concatenate([capsules.a, capsules.b]), np.tile(capsules.link, 2)
    for joint in range(chain.joints):
        push = np.zeros_like(q)
        push[joint] = 1.0
        ahead, behind = (place_points(chain, q + s * _STEP * push, ends, links) for s in (1, -1))
        speeds = np.linalg.norm(ahead - behind, axis=0) / (2 * _STEP)
        fastest = speeds.reshape(2, len(each), -1).max((0, 2))
        assert (fastest <= reach[:, joint] + ROUNDING).all()
        own = capsules.link == joint  # one joint away the bound is exact
        np.testing.assert_allclose(fastest[own], reach[own, joint], atol=1e-7)


REGIONS = {
    "none": (),
    "desk": (DESK,),
    "box": (BOX,),
    "round": (BALL, HULL),
    "all": (Plane((0.309426, -0.206284, 0.928279), -0.5), BOX, DESK, BLOCK),
}
EPS = 1e-9  # margin at the centre of a cell, so that nothing is settled
RATE = 200.0  # [Hz]


def assert_sound(constraints: Constraints, trajectory: Trajectory, c: Array, exact: bool = True) -> Array:
    """What is valid, which comes back, holds everything at many samples; what does not at one is not valid.

    The margins are those at their times where these are exact: no lower bounds of distances.
    """
    found, dense = check(constraints, trajectory, c), smallest(constraints, trajectory, c, RATE)
    least = np.stack([*dense.values()]).min(0)
    assert (least[found.valid] >= -1e-9).all() and not found.valid[least < -1e-9].any()
    for name, margin in found.margins.items():
        states = (trajectory.derivative(c, found.times[name], order) for order in range(constraints.orders))
        at = [x.diagonal().T for x in states]  # each trajectory at its own time
        own = constraints.margins(*at)[name][np.arange(len(c)), found.elements[name]]
        sampled = np.isclose(own, margin, rtol=1e-9, atol=1e-9)
        if exact:
            assert (sampled | (margin < 0)).all()  # else it is a guaranteed one, below zero
    return found.valid


def shaped(arm: Arm, shape: str, seed: int) -> Arm:
    """The arm with its capsules, hulls inside of them, or balls in their place."""
    middles = (arm.capsules.a + arm.capsules.b) / 2
    match shape:
        case "hulls":
            return filled(arm, seed)
        case "balls":  # what surrounds a link is no larger than the link: nothing may be skipped too early
            return replace(arm, capsules=replace(arm.capsules, a=middles, b=middles))
    return arm


@settings(max_examples=40)
@given(
    joints=st.integers(1, 9),
    seed=st.integers(0, 10_000),
    shape=st.sampled_from(["capsules", "balls", "hulls"]),
    regions=st.sampled_from(sorted(REGIONS)),
    clearance=st.sampled_from([0.0, 0.0, 0.05, 0.2]),
    period=st.sampled_from([0.7, 3.0, 8.05]),
    limit=st.sampled_from([np.inf, 30.0, 300.0]),
    higher=st.sets(st.sampled_from(["acceleration", "jerk"])),
)
def test_verdicts_and_margins_on_random_arms(joints, seed, shape, regions, clearance, period, limit, higher):
    arm = shaped(limited(random_chain(joints, seed)[0], sorted(higher), share=0.3), shape, seed)
    torque = np.full(joints, limit)
    torque[::2] = 150.0
    arm = replace(arm if seed % 2 else driven(arm, seed), torque_limit=torque)
    trajectory = Trajectory(joints, 4, period, ((arm.position_lower + arm.position_upper) / 2).tolist())
    constraints = constrained(arm, REGIONS[regions], torque=seed % 3 > 0, clearance=clearance)
    assert_sound(constraints, trajectory, moderate(arm, trajectory, 12, seed), exact=shape != "hulls")


def test_trajectories_of_one_arm_keep_their_own_home(planar: Arm) -> None:
    constraints = Constraints(planar, [DESK])
    for home in ((0.0, 0.0), (0.4, -0.8), (-0.2, 0.1)):
        trajectory = Trajectory(2, 3, 4.0, home)
        assert_sound(constraints, trajectory, moderate(planar, trajectory, 20, seed=3))


def tightened(model, name: str, margin: np.ndarray):
    """A kernel's model in which these margins, of each joint or the smallest distance, are next to none."""
    less = margin - EPS
    match name:
        case "position":
            return model._replace(lower=model.lower + less, upper=model.upper - less)
        case "velocity":
            return model._replace(speed=model.speed - less)
        case "torque":
            return model._replace(torque=model.torque - less)
        case "acceleration" | "jerk":
            higher = model.higher.copy()
            higher[DERIVATIVE_ORDER[name] - 2] -= less
            return model._replace(higher=higher)
    less = less / (2 if name == "collision" else 1)  # of each of the two capsules
    bodies = model.bodies
    shapes, hulls = bodies.shapes, bodies.hulls
    outer = shapes.outer + less
    shapes = shapes._replace(radius=shapes.radius + less, outer=outer, size=shapes.size + abs(less))
    hulls = hulls._replace(radius=hulls.radius + less)
    return model._replace(bodies=bodies._replace(shapes=shapes, hulls=hulls))


def assert_bounded(constraints: Constraints, trajectory: Trajectory, c: Array, half: float) -> set[str]:
    """In single cells no margin falls below what is guaranteed, limits being such that hardly any is settled.

    The names of the constraints that were not come back.
    """
    from sidegan.kernels.proof import everything
    from sidegan.validity.search import MarginSearch

    count, seen = round(trajectory.period / (2 * half)), set()
    for index, single in zip(range(1, count, max(1, count // len(c))), c[:, None]):
        times = 2 * half * index + 2 * half * np.linspace(0, 1, 21)
        for name, margins in margins_within(constraints, trajectory, single, times).items():
            distance = name in ("collision", "keep_out")
            now = margins[10].min() if distance else margins[10]
            search = MarginSearch(constraints, trajectory, single)
            search.model = tightened(search.model, name, now)
            asked = everything(search.model, 1)
            search.visit(np.array([[0, index]]), asked, count, last=True)
            least = search.smallest.margin[0, CONSTRAINTS.index(name)]
            slack = 1e-7 * max(1.0, float(np.abs(now).max()))
            assert float((margins - now).min()) + EPS >= min(least, 0.0) - slack, name
            seen |= {name} if least < 0 else set()  # else it hardly moves
    return seen


def margins_within(constraints: Constraints, trajectory: Trajectory, c: Array, times: Array) -> dict:
    """Margins (T, K) by constraint, of what is inside of all capsules."""
    margins = {name: x[0] for name, x in margins_of(constraints, trajectory, c, times).items()}
    finer = constraints.bodies.hulls.finer
    if finer.any():
        q = trajectory.derivative(c, times, 0)[0]
        asked = np.argwhere(finer & np.ones((len(q), 1), bool))
        inner, where = piece_distances(constraints.bodies, q, asked), tuple(asked.T)
        margins["collision"][where] = np.maximum(margins["collision"][where], inner)
    return margins


@pytest.mark.parametrize("half", [0.05, 0.0005])
@pytest.mark.parametrize(("joints", "shape"), [*((n, "capsules") for n in (1, 2, 5, 9, 7)), (5, "hulls")])
def test_margins_fall_no_further_within_a_cell_than_their_bound(arm: Arm, joints, shape, half) -> None:
    limited = shaped(arm if joints == 7 else random_chain(joints, 0)[0], shape, 0)
    limited = replace(
        driven(limited, scale=100.0),
        acceleration_limit=8.0 * limited.velocity_limit,
        jerk_limit=60.0 * limited.velocity_limit,
    )
    constraints = Constraints(limited, [Plane((0.19518, -0.09759, 0.9759), -0.6), *REGIONS["round"]])
    trajectory = Trajectory(joints, 5, 3.0, ((limited.position_lower + limited.position_upper) / 2).tolist())
    seen = assert_bounded(constraints, trajectory, moderate(limited, trajectory, 8, joints), half)
    assert seen == set(constraints.labels)
