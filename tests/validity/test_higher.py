"""Limits of acceleration and jerk over the whole period: proven, refused, and scaled as time is."""

from dataclasses import replace

import pytest
import torch
from hypothesis import example, given, settings
from hypothesis import strategies as st
from torch import Tensor

from sidegan.motion.compiled.formulas import drift
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER, Arm, load_robot
from sidegan.validity import Constraints, check
from sidegan.validity.bounds import derivative_bound

from .critical import BENT, HIGHEST, drawn, limited, only, scaled_to

BARE = load_robot("planar2")
RATE = 10_000.0  # [Hz] of the samples that a proof is held against
SAMPLES = 30_001


def unhindered(arm: Arm) -> Arm:
    """The arm with nothing else in its way; a check that something else fails leaves margins loose."""
    far, none = torch.full((2,), 1e6, dtype=torch.float64), only(arm.capsules, torch.arange(0))
    return replace(arm, capsules=none, velocity_limit=far, position_lower=-far, position_upper=far)


def peaks(trajectory: Trajectory, c: Tensor, order: int, count: int) -> Tensor:
    """Largest absolute derivative of each joint at so many samples, (B, J)."""
    times = torch.linspace(0, trajectory.period, count, dtype=torch.float64)
    return trajectory.derivative(c, times, order).abs().amax(1)


def at_the_limit(names: list[str], seed: int, period: float, harmonics: int) -> tuple[Constraints, ...]:
    """Arm without anything else in the way, and trajectories around the tightest of these limits."""
    arm = unhindered(limited(BARE, names))
    constraints, trajectory = Constraints(arm, torque=False), Trajectory(2, harmonics, period)
    c = drawn(trajectory, 12, seed)
    use = torch.stack(
        [peaks(trajectory, c, HIGHER[x], 4001) / limit for x, limit in arm.higher_limits.items()]
    )
    size = torch.linspace(0.97, 1.03, len(c), dtype=torch.float64)
    return constraints, trajectory, c * (size / use.amax((0, 2)))[:, None, None, None]


@settings(max_examples=20, deadline=None)
@given(
    names=st.sets(st.sampled_from(sorted(HIGHER)), min_size=1),
    seed=st.integers(0, 10_000),
    period=st.sampled_from([1.3, 4.0, 16.0]),
    harmonics=st.integers(1, 7),
)
def test_a_valid_trajectory_never_exceeds_and_one_that_does_is_refused(
    names: set[str], seed: int, period: float, harmonics: int
) -> None:
    """Not even at one of many samples; and what the proof refuses is at the limit."""
    constraints, trajectory, c = at_the_limit(sorted(names), seed, period, harmonics)
    found = check(constraints, trajectory, c)
    limits = constraints.higher
    use = torch.stack([peaks(trajectory, c, HIGHER[x], SAMPLES) / limits[x] for x in limits]).amax((0, 2))
    assert (use[found.valid] <= 1).all() and found.valid.any()
    assert not found.valid[use > 1].any() and (use > 1).any()
    assert (use[~found.valid] > 0.9995).all()


@pytest.mark.parametrize("name", HIGHER)
def test_ten_kilohertz_find_the_margin_that_the_check_gives(name: str) -> None:
    constraints, trajectory, c = at_the_limit([name], 3, 2.0, 5)
    c = c[:2]  # valid: the margin is a sampled one, within what the cells leave open
    found = check(constraints, trajectory, c)
    times = trajectory.times(RATE)
    states = [trajectory.derivative(c, times, k) for k in range(constraints.orders)]
    margins = constraints.margins(*(x.flatten(0, 1) for x in states))[name]
    dense = margins.reshape(len(c), -1).amin(1)
    assert (found.margins[name] >= dense - 1e-9).all()
    torch.testing.assert_close(found.margins[name], dense, rtol=0.05, atol=0.02 * HIGHEST[name])


@pytest.mark.parametrize("name", HIGHER)
def test_a_failure_says_which_joint_and_when(name: str) -> None:
    trajectory, limits = Trajectory(2, 3, 6.0), torch.tensor([torch.inf, HIGHEST[name]]).double()
    constraints = Constraints(replace(BARE, **{f"{name}_limit": limits}))
    c = torch.zeros(1, *trajectory.shape, dtype=torch.float64)
    c[0, :, 2, 0] = 1.0  # both joints swing; only the elbow's acceleration is limited

    def margin(c: Tensor) -> Tensor:
        return HIGHEST[name] - peaks(trajectory, c, HIGHER[name], 3001)[:, 1]

    bad = scaled_to(margin, c, -0.05 * HIGHEST[name], most=40.0)
    found = check(constraints, trajectory, torch.cat([0.1 * bad, bad]))
    assert found.margins[name][0] > 0 > found.margins[name][1]
    failure = {one.constraint: one for one in found.failures(1)}[name]
    assert failure.where == "elbow" and f"{name} of elbow at " in str(failure)
    x = trajectory.derivative(bad, torch.tensor([failure.time], dtype=torch.float64), HIGHER[name])
    assert HIGHEST[name] - float(x[0, 0, 1].abs()) == pytest.approx(failure.margin)


@settings(max_examples=30, deadline=None)
@given(
    order=st.sampled_from(sorted(HIGHER.values())),
    seed=st.integers(0, 1000),
    harmonics=st.integers(1, 8),
    half=st.sampled_from([0.1, 0.02, 1e-3]),
    centre=st.floats(0, 1),
)
def test_no_derivative_drifts_further_in_a_cell_than_its_bound(
    order: int, seed: int, harmonics: int, half: float, centre: float
) -> None:
    trajectory = Trajectory(3, harmonics, 3.0)
    c = drawn(trajectory, 6, seed)
    middle = half + centre * (3.0 - 2 * half)
    times = middle + half * torch.linspace(-1, 1, 41, dtype=torch.float64)
    times = times.clamp(0, 3.0)
    x = trajectory.derivative(c, times, order)
    change = (x - x[:, 20:21]).abs().amax(1)
    bound = derivative_bound(trajectory, c, order + 2)
    rate = trajectory.derivative(c, times[20:21], order + 1)[:, 0]
    assert (change <= drift(rate, bound, half) * (1 + 1e-9) + 1e-9).all()


@settings(max_examples=20, deadline=None)
@example(seed=658, s=0.3046875, period=17.0)
@given(seed=st.integers(0, 1000), s=st.floats(0.3, 4.0), period=st.floats(1.0, 20.0))
def test_motion_that_takes_s_times_as_long_has_accelerations_of_one_over_s_squared(
    seed: int, s: float, period: float
) -> None:
    fast, slow = Trajectory(2, 4, period), Trajectory(2, 4, s * period)
    c = drawn(fast, 5, seed)
    share = torch.linspace(0, 1, 201, dtype=torch.float64)
    for order, factor in ((0, 1.0), (1, 1 / s), (2, 1 / s**2), (3, 1 / s**3)):
        x = fast.derivative(c, period * share, order)
        y = slow.derivative(c / s, s * period * share, order)  # coefficients are velocities
        torch.testing.assert_close(y, factor * x, rtol=1e-9, atol=1e-9 * float(x.abs().max()))
    arm = replace(unhindered(BARE), acceleration_limit=torch.full((2,), 5.0).double())
    eased = replace(arm, acceleration_limit=5.0 / s**2 * torch.ones(2).double())
    one = check(Constraints(arm, torque=False), fast, c).margins["acceleration"]
    other = check(Constraints(eased, torque=False), slow, c / s).margins["acceleration"]
    both = (one > 0) & (other > 0)
    # margins of what is clearly valid come from coarse cells, of which the slower motion has others
    torch.testing.assert_close(other[both], one[both] / s**2, rtol=0.05, atol=0.03 * 5.0 / s**2)
    # closer to the limit than this, the finest cells need not decide
    clear = (one.abs() > 0.05) | (s**2 * other.abs() > 0.05)
    assert torch.equal((one > 0)[clear], (other > 0)[clear])


def test_jerk_steps_at_the_ends_and_nowhere_else() -> None:
    """Position, velocity and acceleration rest there; in between the jerk is continuous."""
    trajectory = Trajectory(2, 5, 8.0)
    c = drawn(trajectory, 9)
    ends = torch.tensor([0.0, 8.0], dtype=torch.float64)
    for order in (1, 2):
        assert trajectory.derivative(c, ends, order).abs().max() < 1e-9
    assert trajectory.derivative(c, ends, 3).abs().min() > 1e-3
    steps = trajectory.derivative(c, torch.linspace(0, 8, 8001, dtype=torch.float64), 3).diff(dim=1)
    bound = derivative_bound(trajectory, c, 4)
    assert (steps.abs().amax(1) <= 1e-3 * bound * (1 + 1e-9)).all()


def test_finite_differences_give_the_jerk() -> None:
    trajectory, h = Trajectory(2, 4, 5.0), 1e-4
    c = drawn(trajectory, 3, 1)
    times = torch.linspace(0.1, 4.9, 50, dtype=torch.float64)
    up, down = (trajectory.derivative(c, times + x, 2) for x in (h, -h))
    torch.testing.assert_close((up - down) / (2 * h), trajectory.derivative(c, times, 3), atol=1e-5, rtol=0)


def test_limits_are_said_and_jerk_is_asked_for(arm: Arm) -> None:
    constraints = Constraints(limited(arm, ["acceleration", "jerk"]))
    said = constraints.described()
    assert said.startswith("position and velocity of 7 joints, acceleration of 5, jerk of 5, torque of 7; ")
    assert list(constraints.labels)[:4] == ["position", "velocity", "acceleration", "jerk"]
    still = torch.zeros(1, 7, dtype=torch.float64)
    margins = constraints.margins(still, still, 1 - still, -2 - still)
    assert margins["acceleration"][0, 0] == pytest.approx(8 * float(arm.velocity_limit[0]) - 1)
    assert margins["jerk"][0, 1] == pytest.approx(60 * float(arm.velocity_limit[1]) - 2)
    assert margins["jerk"][0, 2] == torch.inf
    shares = constraints.relative(margins, 1.0)
    assert shares["jerk"][0, 2] == 1 and shares["acceleration"][0, 0] < 1
    constraints.refuse_home(BENT)


def test_infinite_limits_are_none(arm: Arm) -> None:
    none = torch.full((7,), torch.inf, dtype=torch.float64)
    assert Constraints(replace(arm, acceleration_limit=none, jerk_limit=none)).higher == {}
