"""The check of whole trajectories: what dense sampling finds, it finds; what is comfortable, it accepts."""

import sys
from collections.abc import Callable
from dataclasses import replace
from functools import cache, partial

import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from torch import Tensor

from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER, Arm, load_robot
from sidegan.validity import Constraints, Plane, check
from tests.chains import random_chain

from .critical import BENT, BOX, DESK, HIGHEST, drawn, limited, margins_of, only, smallest

KINDS = ("position", "velocity", "acceleration", "jerk", "torque", "collision", "desk", "box")
COARSE = 20.0  # [Hz] centres and edges of the check's first cells
DENSE = 2_000.0  # [Hz]
TINY = dict(zip(KINDS, (1e-5, 1e-5, 1e-5, 1e-4, 1e-4, 1e-6, 1e-6, 1e-6)))
COMFORTABLE = dict(zip(KINDS, (1e-3, 5e-3, 1e-2, 1e-1, 1.0, 1e-3, 1e-3, 1e-3)))


def unhindered(arm: Arm) -> Arm:
    """The arm with nothing in its way; a check that something else fails leaves margins loose."""
    far, none = torch.full((arm.joints,), 1e6, dtype=torch.float64), only(arm.capsules, torch.arange(0))
    free = replace(arm, velocity_limit=far, torque_limit=torch.inf * far, capsules=none)
    return replace(free, position_lower=-far, position_upper=far)


def isolated(arm: Arm, kind: str) -> tuple[Constraints, str]:
    """Constraints that only one kind can violate, and its margin's name."""
    bare, capsules = unhindered(arm), arm.capsules
    match kind:
        case "desk" | "box":
            last = replace(bare, capsules=only(capsules, torch.tensor([-1])))
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
            limits = {f"{kind}_limit": torch.full_like(arm.velocity_limit, HIGHEST[kind])}
    return Constraints(replace(bare, **limits)), kind


def scaled_to(margin: Callable[[Tensor], Tensor], c: Tensor, target: float, most: float = 4.0) -> Tensor:
    """Each trajectory scaled up from rest until its margin, (B,), first falls to the target.

    The margin stays above the target by a hair. Those that never fall so far are left out.
    """
    scales = torch.linspace(0, most, 41, dtype=c.dtype)
    below = torch.stack([margin(c * s) < target for s in scales])
    falls = below.any(0) & ~below[0]
    c, first = c[falls], below.int().argmax(0)[falls]
    low, high = scales[first - 1], scales[first]
    everything = torch.ones(len(below[0]), *c.shape[1:], dtype=c.dtype)
    for _ in range(30):
        middle = (low + high) / 2
        everything[falls] = c * middle[:, None, None, None]
        bad = (margin(everything) < target)[falls]
        low, high = torch.where(bad, low, middle), torch.where(bad, middle, high)
    return c * low[:, None, None, None]


def family(arm: Arm, period: float = 3.0) -> Trajectory:
    return Trajectory(arm.joints, 5, period, BENT if arm.joints == 7 else None)


@pytest.mark.parametrize("kind", KINDS)
def test_every_violation_is_caught_and_a_comfortable_margin_accepted(kind: str, arm: Arm) -> None:
    (constraints, name), trajectory = isolated(arm, kind), family(arm)

    def least(rate: float, c: Tensor) -> Tensor:
        return smallest(constraints, trajectory, c, rate)[name]

    between = scaled_to(partial(least, COARSE), drawn(trajectory, 24), target=1e-9)
    bad = least(DENSE, between) < 0
    assert (least(COARSE, between) >= 0).all() and bad.sum() >= 10  # only between coarse samples
    validity = check(constraints, trajectory, between)
    assert not validity.valid[bad].any()
    for i in torch.nonzero(bad)[:, 0].tolist():
        assert [failure.constraint for failure in validity.failures(i)] == [name]
    c = drawn(trajectory, 8, seed=1)
    tiny = scaled_to(partial(least, 200.0), c, target=-TINY[kind]) * (1 + 1e-9)
    assert len(tiny) >= 5 and not check(constraints, trajectory, tiny).valid.any()
    good = scaled_to(partial(least, 200.0), c, target=COMFORTABLE[kind])
    good = good[least(DENSE, good) > 0.9 * COMFORTABLE[kind]]
    validity = check(constraints, trajectory, good)
    assert len(good) >= 5 and validity.valid.all(), validity.margins


@cache
def near_the_limits(name: str | int) -> tuple[Constraints, Trajectory, Tensor, Tensor]:
    """Trajectories around their tightest limit, and the smallest of each one's dense margins."""
    if isinstance(name, str):
        arm = load_robot(name)
        constraints, trajectory = Constraints(arm, [DESK]), family(arm, period=4.0)
    else:  # a chain with prismatic joints, which is free at rest
        arm = random_chain(4, name)[0]
        constraints = Constraints(arm, [Plane((0.0, 0.6, 0.8), -0.6)])
        trajectory = Trajectory(4, 4, 3.0, ((arm.position_lower + arm.position_upper) / 2).tolist())
    count = 100 if arm.joints == 2 else 40

    def coarse(c: Tensor) -> Tensor:
        margins = smallest(constraints, trajectory, c, COARSE)
        return torch.stack([x / (40 if name == "torque" else 1) for name, x in margins.items()]).amin(0)

    c = scaled_to(coarse, drawn(trajectory, count, seed=2), target=1e-4)
    generator = torch.Generator().manual_seed(3)
    c = c * torch.empty(len(c), 1, 1, 1, dtype=c.dtype).uniform_(0.98, 1.02, generator=generator)
    dense = torch.stack(list(smallest(constraints, trajectory, c, DENSE).values())).amin(0)
    return constraints, trajectory, c, dense


@pytest.mark.parametrize("name", ["kuka_lwr4", "planar2", 1, 10])
def test_valid_means_that_dense_sampling_finds_nothing(name):
    constraints, trajectory, c, dense = near_the_limits(name)
    validity = check(constraints, trajectory, c)
    assert 0.1 < validity.valid.double().mean() < 0.9
    assert (dense[validity.valid] >= 0).all()
    # Nor is it timid: what it refuses is bad, or all but.
    assert (dense[~validity.valid] < 1e-3).all()


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
def test_failure_says_what_where_when_and_by_how_much(constraint, moved, by, where, planar):
    one = planar if by < 1 else unhindered(limited(planar, [constraint]))
    constraints, trajectory = Constraints(one, [DESK], torque=False), Trajectory(2, 3, 6.0)
    c = torch.zeros(1, *trajectory.shape, dtype=torch.float64)
    c[0][moved] = 1.0
    bad = scaled_to(lambda c: smallest(constraints, trajectory, c, 1000.0)[constraint], c, -by, most=40.0)
    validity = check(constraints, trajectory, torch.cat([0.1 * bad, bad]))
    assert validity.valid.tolist() == [True, False] and validity.failures(0) == []
    failure = {failure.constraint: failure for failure in validity.failures(1)}[constraint]
    assert failure.where == where and failure.margin == pytest.approx(-by, rel=0.2)
    at = torch.tensor([failure.time], dtype=torch.float64)
    states = (trajectory.derivative(bad, at, order)[0] for order in range(constraints.orders))
    assert float(constraints.margins(*states)[constraint].min()) == pytest.approx(failure.margin)
    assert str(failure) == f"{constraint} of {where} at {failure.time:.3f} s: margin {failure.margin:.4g}"


def test_margins_are_the_smallest_sampled(arm: Arm) -> None:
    constraints = Constraints(limited(arm, ["acceleration", "jerk"]), [DESK])
    trajectory = Trajectory(7, home=BENT)
    c = 0.01 * drawn(trajectory, 5)
    validity, dense = check(constraints, trajectory, c), smallest(constraints, trajectory, c, 500.0)
    assert validity.valid.all() and set(validity.margins) == set(dense) == set(constraints.labels)
    for name, margin in validity.margins.items():
        torch.testing.assert_close(margin, dense[name], rtol=0.02, atol=2e-3)
        at = margins_of(constraints, trajectory, c, validity.times[name])[name].amin(2).diagonal()
        torch.testing.assert_close(margin, at)


def test_result_depends_neither_on_the_batch_nor_on_the_chunks(arm, monkeypatch):
    constraints, trajectory = Constraints(arm, [DESK]), family(arm)
    c = 0.12 * drawn(trajectory, 12)
    whole = check(constraints, trajectory, c)
    assert 0 < whole.valid.sum() < 12
    single = [check(constraints, trajectory, one[None]) for one in c]
    monkeypatch.setattr(sys.modules["sidegan.validity.check"], "_CELLS_AT_ONCE", 70)
    chunked = check(constraints, trajectory, c)
    clear = torch.stack(list(whole.margins.values())).abs().amin(0) > 1e-9  # elsewhere rounding decides
    assert clear.sum() > 6
    assert torch.equal(whole.valid[clear], chunked.valid[clear])
    assert torch.equal(whole.valid[clear], torch.cat([v.valid for v in single])[clear])
    for name, margin in whole.margins.items():
        torch.testing.assert_close(chunked.margins[name], margin)
        torch.testing.assert_close(torch.cat([v.margins[name] for v in single]), margin)


def test_a_state_on_the_limit_is_not_called_valid(planar: Arm) -> None:
    """Its margin is zero, but no sample can show that it stays so."""
    trajectory = Trajectory(2, 2, 3.0, home=(2.6, 0.0))
    c = torch.zeros(1, *trajectory.shape, dtype=torch.float64)
    c[0, 0, 0, 1] = -0.1
    validity = check(Constraints(planar), trajectory, torch.cat([c, -c]))
    assert not validity.valid.any()
    assert all(validity.failures(i)[0].where == "shoulder" for i in range(2))


@pytest.mark.parametrize("period", [0.01, 0.13, 560.0])
def test_any_period_can_be_checked(planar: Arm, period: float) -> None:
    trajectory = Trajectory(2, 6, period)
    c = drawn(trajectory, 2)
    peak = trajectory.roll_out(c, trajectory.times(2000 / period))
    fast = (peak.velocity.abs() / planar.velocity_limit).amax((1, 2))
    far = (peak.position.abs() / planar.position_upper).amax((1, 2))
    c = c / torch.maximum(fast, far)[:, None, None, None]
    constraints = Constraints(planar, torque=False)
    assert not check(constraints, trajectory, 1.001 * c).valid.any()
    assert check(constraints, trajectory, 0.3 * c).valid.all()


def test_single_precision_is_checked_in_double(arm: Arm, device: torch.device) -> None:
    constraints, trajectory = Constraints(arm, [DESK]), Trajectory(7, home=BENT)
    c = 0.05 * drawn(trajectory, 10).float()
    single, double = check(constraints, trajectory, c.to(device)), check(constraints, trajectory, c.double())
    clear = torch.stack(list(double.margins.values())).abs().amin(0) > 1e-9
    assert clear.any() and torch.equal(single.valid[clear], double.valid[clear])
    for name, margin in single.margins.items():
        torch.testing.assert_close(margin, double.margins[name])


def test_no_trajectory_at_all_and_absurd_ones(planar: Arm) -> None:
    constraints, trajectory = Constraints(planar, [DESK, BOX]), Trajectory(2)
    validity = check(constraints, trajectory, torch.zeros(0, *trajectory.shape))
    assert validity.valid.shape == (0,) and all(m.shape == (0,) for m in validity.margins.values())
    for size in (1e3, 1e150, 1e200, 1e300):
        c = torch.full((2, *trajectory.shape), size, dtype=torch.float64)
        c[1, :, ::2] *= -1
        validity = check(constraints, trajectory, c)
        assert not validity.valid.any() and validity.failures(0)


@settings(max_examples=20, deadline=None)
@given(
    names=st.sets(st.sampled_from(sorted(HIGHER)), min_size=1),
    seed=st.integers(0, 10_000),
    period=st.sampled_from([1.3, 4.0, 16.0]),
    harmonics=st.integers(1, 7),
)
def test_a_valid_trajectory_never_exceeds_and_one_that_does_is_refused(names, seed, period, harmonics):
    """Not even at one of many samples; and what the proof refuses is at the limit."""
    arm = unhindered(limited(load_robot("planar2"), sorted(names)))
    constraints, trajectory = Constraints(arm, torque=False), Trajectory(2, harmonics, period)
    limits = arm.higher_limits

    def use(c: Tensor, samples: int) -> Tensor:
        times = torch.linspace(0, period, samples, dtype=torch.float64)
        peaks = {x: trajectory.derivative(c, times, HIGHER[x]).abs().amax(1) for x in limits}
        return torch.stack([peaks[x] / limits[x] for x in limits]).amax((0, 2))

    c = drawn(trajectory, 12, seed)
    c = c * (torch.linspace(0.97, 1.03, 12, dtype=torch.float64) / use(c, 4001))[:, None, None, None]
    valid, used = check(constraints, trajectory, c).valid, use(c, 30_001)
    assert (used[valid] <= 1).all() and valid.any()
    assert not valid[used > 1].any() and (used > 1).any()
    assert (used[~valid] > 0.9995).all()


@settings(max_examples=20, deadline=None)
@example(seed=658, s=0.3046875, period=17.0)
@given(seed=st.integers(0, 1000), s=st.floats(0.3, 4.0), period=st.floats(1.0, 20.0))
def test_motion_that_takes_s_times_as_long_has_accelerations_of_one_over_s_squared(seed, s, period):
    fast, slow = Trajectory(2, 4, period), Trajectory(2, 4, s * period)
    c = drawn(fast, 5, seed)
    arm = replace(unhindered(load_robot("planar2")), acceleration_limit=torch.full((2,), 5.0).double())
    eased = replace(arm, acceleration_limit=5.0 / s**2 * torch.ones(2).double())
    one = check(Constraints(arm, torque=False), fast, c).margins["acceleration"]
    other = check(Constraints(eased, torque=False), slow, c / s).margins["acceleration"]  # c: velocities
    both = (one > 0) & (other > 0)
    # margins of what is clearly valid come from coarse cells, of which the slower motion has others
    torch.testing.assert_close(other[both], one[both] / s**2, rtol=0.05, atol=0.03 * 5.0 / s**2)
    # closer to the limit than this, the finest cells need not decide
    clear = (one.abs() > 0.05) | (s**2 * other.abs() > 0.05)
    assert torch.equal((one > 0)[clear], (other > 0)[clear])
