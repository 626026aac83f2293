"""The check of whole trajectories: what dense sampling finds, it finds; what is comfortable, it accepts."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sidegan.base.arrays import Array
from sidegan.base.threads import on_threads
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check

from .critical import BENT, BOX, DESK, HIGHEST, drawn, limited, only, smallest

KINDS = ("position", "velocity", "acceleration", "jerk", "torque", "collision", "desk", "box")
COARSE = 20.0  # [Hz] centres and edges of the check's first cells
DENSE = 2_000.0  # [Hz]
TINY = dict(zip(KINDS, (1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6)))
COMFORTABLE = dict(zip(KINDS, (1e-3, 5e-3, 1e-2, 1e-1, 1.0, 1e-3, 1e-3, 1e-3)))


def unhindered(arm: Arm) -> Arm:
    """The arm with nothing in its way; a check that something else fails leaves margins loose."""
    far, none = np.full(arm.joints, 1e6), only(arm.capsules, np.arange(0))
    free = replace(arm, velocity_limit=far, torque_limit=np.inf * far, capsules=none)
    return replace(free, position_lower=-far, position_upper=far)


def isolated(arm: Arm, kind: str) -> tuple[Constraints, str]:
    """Constraints that only one kind can violate, and its margin's name."""
    bare, capsules = unhindered(arm), arm.capsules
    match kind:
        case "desk" | "box":
            last = replace(bare, capsules=only(capsules, np.array([-1])))
            return Constraints(last, [DESK if kind == "desk" else BOX]), "keep_out"
        case "collision":
            return Constraints(replace(bare, capsules=replace(capsules, radius=capsules.radius + 0.02))), kind
        case "position":
            limits = {name: 0.7 * getattr(arm, name) for name in ("position_lower", "position_upper")}
        case "torque":
            limits = {"torque_limit": 0.4 * arm.torque_limit}
        case "velocity":
            limits = {"velocity_limit": arm.velocity_limit}
        case _:
            limits = {f"{kind}_limit": np.full_like(arm.velocity_limit, HIGHEST[kind])}
    return Constraints(replace(bare, **limits)), kind


def scaled_to(margin: Callable[[Array], Array], c: Array, target: float, most: float = 4.0) -> Array:
    """Each trajectory scaled up from rest until its margin, (B,), first falls to the target.

    The margin stays above the target by a hair. Those that never fall so far are left out.
    """
    scales = np.linspace(0, most, 41)
    below = np.stack([margin(c * s) < target for s in scales])
    falls = below.any(0) & ~below[0]
    c, first = c[falls], below.argmax(0)[falls]
    low, high = scales[first - 1], scales[first]
    for _ in range(30):
        middle = (low + high) / 2
        bad = margin(c * middle[:, None, None, None]) < target
        low, high = np.where(bad, low, middle), np.where(bad, middle, high)
    return c * low[:, None, None, None]


@pytest.mark.parametrize("kind", KINDS)
def test_violations_are_caught_and_comfortable_margins_accepted(kind: str, arm: Arm) -> None:
    (constraints, name), trajectory = isolated(arm, kind), Trajectory(7, 5, 3.0, BENT)

    def least(rate: float, c: Array) -> Array:
        return smallest(constraints, trajectory, c, rate)[name]

    between = scaled_to(partial(least, COARSE), drawn(trajectory, 24), target=1e-9)
    bad = least(DENSE, between) < 0
    assert (least(COARSE, between) >= 0).all() and bad.sum() >= 10  # only between coarse samples
    validity = check(constraints, trajectory, between)
    assert not validity.valid[bad].any()
    for i in np.flatnonzero(bad).tolist():
        assert [failure.constraint for failure in validity.failures(i)] == [name]
    c = drawn(trajectory, 8, seed=1)
    tiny = scaled_to(partial(least, 200.0), c, target=-TINY[kind]) * (1 + 1e-9)
    assert len(tiny) >= 5 and not check(constraints, trajectory, tiny).valid.any()
    good = scaled_to(partial(least, 200.0), c, target=COMFORTABLE[kind])
    good = good[least(DENSE, good) > 0.9 * COMFORTABLE[kind]]
    validity = check(constraints, trajectory, good)
    assert len(good) >= 5 and validity.valid.all(), validity.margins


# Constraint, which coefficient moves alone, by how much it is exceeded, and what the failure names.
PLANTED = [
    ("position", (1, 0, 1), 0.05, "elbow"),
    ("velocity", (1, 2, 0), 0.05, "elbow"),
    ("acceleration", (1, 2, 0), 1.5, "elbow"),
    ("jerk", (1, 2, 0), 30.0, "elbow"),
    ("collision", (1, 0, 1), 0.01, "base – forearm"),
    ("keep_out", (0, 0, 1), 0.01, "forearm in region 0"),
]


@pytest.mark.parametrize(("constraint", "moved", "by", "where"), PLANTED)
def test_a_failure_states_constraint_place_time_and_margin(constraint, moved, by, where, planar):
    limited_arm = planar if by < 1 else unhindered(limited(planar, [constraint]))
    constraints, trajectory = Constraints(limited_arm, [DESK], torque=False), Trajectory(2, 3, 6.0)
    c = np.zeros((1, *trajectory.shape))
    c[0][moved] = 1.0
    bad = scaled_to(lambda c: smallest(constraints, trajectory, c, 1000.0)[constraint], c, -by, most=40.0)
    validity = check(constraints, trajectory, np.concatenate([0.1 * bad, bad]))
    assert validity.valid.tolist() == [True, False] and validity.failures(0) == []
    failure = {failure.constraint: failure for failure in validity.failures(1)}[constraint]
    assert failure.where == where and failure.margin == pytest.approx(-by, rel=0.2)
    at = np.array([failure.time])
    states = (trajectory.derivative(bad, at, order)[0] for order in range(constraints.orders))
    assert float(constraints.margins(*states)[constraint].min()) == pytest.approx(failure.margin)
    assert str(failure) == f"{constraint} of {where} at {failure.time:.3f} s: margin {failure.margin:.4g}"


def test_result_depends_on_neither_batch_nor_threads(arm):
    constraints, trajectory = Constraints(arm, [DESK]), Trajectory(7, 5, 3.0, BENT)
    c = 0.12 * drawn(trajectory, 300)  # cells enough for three threads
    with on_threads(3):
        whole = check(constraints, trajectory, c)
    single = [check(constraints, trajectory, row[None]) for row in c[:12]]
    valid = np.concatenate([validity.valid for validity in single])
    clear = np.abs(np.stack(list(whole.margins.values()))[:, :12]).min(0) > 1e-9  # elsewhere rounding decides
    assert clear.sum() > 6 and 0 < valid.sum() < 12
    assert np.array_equal(whole.valid[:12][clear], valid[clear])
    for name, margin in whole.margins.items():
        np.testing.assert_allclose(np.concatenate([v.margins[name] for v in single]), margin[:12], atol=1e-9)


def test_a_state_on_the_limit_is_not_valid(planar: Arm) -> None:
    """Its margin is zero, but no sample can show that it stays so."""
    trajectory = Trajectory(2, 2, 3.0, home=(2.6, 0.0))
    c = np.zeros((1, *trajectory.shape))
    c[0, 0, 0, 1] = -0.1
    validity = check(Constraints(planar), trajectory, np.concatenate([c, -c]))
    assert not validity.valid.any()
    assert all(validity.failures(i)[0].where == "shoulder" for i in range(2))


@pytest.mark.parametrize("period", [0.01, 0.13, 560.0])
def test_any_period_can_be_checked(planar: Arm, period: float) -> None:
    trajectory = Trajectory(2, 6, period)
    c = drawn(trajectory, 2)
    peak = trajectory.roll_out(c, trajectory.times(2000 / period))
    fast = (np.abs(peak.velocity) / planar.velocity_limit).max((1, 2))
    far = (np.abs(peak.position) / planar.position_upper).max((1, 2))
    c = c / np.maximum(fast, far)[:, None, None, None]
    constraints = Constraints(planar, torque=False)
    assert not check(constraints, trajectory, 1.001 * c).valid.any()
    assert check(constraints, trajectory, 0.3 * c).valid.all()


def test_empty_batches_and_absurd_sizes_are_checked(planar: Arm) -> None:
    constraints, trajectory = Constraints(planar, [DESK, BOX]), Trajectory(2)
    validity = check(constraints, trajectory, np.zeros((0, *trajectory.shape)))
    assert validity.valid.shape == (0,) and all(m.shape == (0,) for m in validity.margins.values())
    for size in (1e3, 1e150, 1e200, 1e300):
        c = np.full((2, *trajectory.shape), size)
        c[1, :, ::2] *= -1
        validity = check(constraints, trajectory, c)
        assert not validity.valid.any() and validity.failures(0)
