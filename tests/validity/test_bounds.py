"""Bounds over a cell are true bounds: everything sampled inside the cell stays below them."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from torch import Tensor
from torch.autograd.functional import jvp

from sidegan.motion.compiled.formulas import drift
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER, Arm
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from sidegan.validity.bounds import (
    CellMotion,
    Slack,
    capsule_reach,
    cell_motion,
    derivative_bound,
    jerk_bound,
    torque_bounds,
)
from sidegan.validity.capsules import capsule_axes
from sidegan.validity.moving import Moving
from tests.chains import random_chain, random_states

from .critical import cells, drawn, margins_of

CHAINS = [0, 1, 2, 3, 5, 9]  # joints; 0: the LWR
REGIONS = (
    Plane((0.2, -0.1, 1.0), -0.3),
    Box((0.2, -0.4, -0.5), (0.6, 0.1, 0.4)),
    Sphere((-0.4, 0.3, 0.2), 0.2),
    Convex.between((-0.3, -0.4, 0.1), (-0.1, -0.5, 0.6), 0.15),
)
ROUNDING = 1e-9


@pytest.fixture
def chain(request: pytest.FixtureRequest, arm: Arm) -> Arm:
    """A random chain, or the LWR; in the longest chain slides reach far, and mostly downwards."""
    one = random_chain(request.param, 0)[0] if request.param else arm
    mirrored = {"position_lower": -one.position_upper, "position_upper": -one.position_lower}
    return replace(one, translation=0.1 * one.translation, **mirrored) if one.joints == 9 else one


def within_limits(arm: Arm, batch: int, seed: int) -> tuple[Trajectory, Tensor]:
    """Trajectories that use up to the whole position range, with no regard to speed."""
    middle = (arm.position_lower + arm.position_upper) / 2
    trajectory = Trajectory(arm.joints, 5, 3.0, middle)
    c = drawn(trajectory, batch, seed)
    reach = (trajectory.roll_out(c, trajectory.times(100)).position - middle).abs().amax(1)
    return trajectory, c * ((arm.position_upper - arm.position_lower) / 2 / reach)[:, :, None, None]


@pytest.mark.parametrize("half", [0.05, 0.0005])
@pytest.mark.parametrize("chain", CHAINS, indirect=True)
def test_no_margin_changes_by_more_than_its_slack(chain: Arm, half: float) -> None:
    constraints = Constraints(chain, REGIONS)
    trajectory, c = within_limits(chain, 8, chain.joints)
    slack = Slack(constraints)
    for times, _, _, cell in cells(trajectory, c, half):
        bounds = slack.of(cell, half)
        for name, margins in margins_of(constraints, trajectory, c, times).items():
            change = (margins - margins[:, 10:11]).abs().amax(1)
            assert (change <= bounds[name] + ROUNDING).all(), name


def test_slack_shrinks_with_the_cell(arm: Arm) -> None:
    """At the finest cells, 0.1 ms, it hides no more than 1 mm, 1 mrad, 1 mrad/s or 1 N·m."""
    trajectory = Trajectory(7)
    c = 0.2 * drawn(trajectory, 50)
    motion = trajectory.roll_out(c, trajectory.grid(40))
    jerk = jerk_bound(trajectory, c, 160)[:, None].expand_as(motion.velocity).flatten(0, 1)
    cell = cell_motion(motion.velocity.flatten(0, 1), motion.acceleration.flatten(0, 1), jerk, 0 * jerk, 5e-5)
    slack = Slack(Constraints(arm, [Plane((0, 0, 1), 0.1)])).of(cell, 5e-5)
    assert all(bound.max() < 1e-3 for name, bound in slack.items() if name != "torque")
    assert slack["torque"].max() < 1.0


def test_cell_motion_is_taylors_remainder() -> None:
    speed, acceleration, jerk = (torch.tensor([[x]], dtype=torch.float64) for x in (-2.0, 3.0, 6.0))
    cell = cell_motion(speed, acceleration, jerk, 0 * jerk, half=0.5)
    found = [float(x) for x in (cell.position_change, cell.velocity_change, cell.speed, cell.acceleration)]
    assert found == pytest.approx([0.5 * 2 + 0.125 * 3 + 6 / 48, 0.5 * 3 + 0.125 * 6, 2 + 2.25, 3 + 3])


@pytest.mark.parametrize("chain", CHAINS, indirect=True)
def test_torques_change_no_faster_than_their_bounds(chain: Arm) -> None:
    """From gravity alone to inertia alone; their rates by the chain rule, twice."""
    q, dq, ddq = random_states(chain, 300, chain.joints)
    size = torch.logspace(-2, 2, 300, dtype=torch.float64)[:, None]
    generator = torch.Generator().manual_seed(chain.joints)
    higher = torch.randn(2, *ddq.shape, generator=generator, dtype=torch.float64) * size**2
    states = (q, dq * size, ddq * size.flip(0), *higher)

    def rate_of(*states: Tensor) -> Tensor:
        return jvp(RigidBody(chain).torque, states[:3], states[1:4], create_graph=True)[1]

    rate, change = jvp(rate_of, states[:4], states[1:])
    torch.testing.assert_close(RigidBody(chain).torque_rate(*states[:4]), rate)
    still = torch.zeros_like(states[0])
    bounds = torque_bounds(chain, CellMotion(still, still, *(x.abs() for x in states[1:])))
    for value, bound in zip((rate, change), bounds, strict=True):
        assert (value.abs() <= bound * (1 + ROUNDING)).all()


@pytest.mark.parametrize("half", [0.05, 0.0005])
@pytest.mark.parametrize("seed", range(3))
def test_no_link_comes_nearer_to_a_region_in_a_cell_than_its_bound(seed: int, half: float) -> None:
    constraints, sharp = Constraints(random_chain(5, seed)[0], REGIONS), []
    trajectory, c = within_limits(constraints.arm, 6, seed)
    c, slack = 0.3 * c, Slack(constraints)
    for times, q, dq, cell in cells(trajectory, c, half):
        sampled = margins_of(constraints, trajectory, c, times)["keep_out"]
        moving = Moving(constraints.pieces, slack, q, dq, cell, half)
        asked = torch.nonzero(sampled[:, 10] > 0)
        least = moving.regions(constraints.kept_out, constraints.guarded, asked)
        assert (least <= sampled.amin(1)[tuple(asked.T)] + 1e-9).all()
        change = slack.of(cell, half)["keep_out"][tuple(asked.T)]
        sharp.append((sampled[:, 10][tuple(asked.T)] - least) / change)
    if half < 0.01:  # what is left is how paths bend, and what joints' motion does not do away from a region
        assert torch.cat(sharp).median() < 0.6


def sparse_chain(seed: int) -> Arm:
    """Three joints along the axes, with half of all offsets, inertias and gravity gone."""
    arm, _ = random_chain(3, seed)
    generator = torch.Generator().manual_seed(seed)

    def some(*shape: int) -> Tensor:
        return (torch.rand(*shape, generator=generator) < 0.5).double()

    prismatic = torch.rand(3, generator=generator) < 0.4
    reach = torch.where(prismatic, 1e-9, 3.0).double()
    return replace(
        arm,
        prismatic=prismatic,
        rotation=torch.eye(3, dtype=torch.float64).expand(3, 3, 3),
        axis=torch.eye(3, dtype=torch.float64)[torch.randint(3, (3,), generator=generator)],
        translation=arm.translation * some(3, 1),
        gravity=arm.gravity * some(1),
        inertial_parameters=arm.inertial_parameters
        * some(3, 3).repeat_interleave(torch.tensor([1, 3, 6]), dim=1),
        position_lower=-reach,
        position_upper=reach,
    )


def test_torque_bounds_hold_where_a_single_term_rules() -> None:
    """Speeds, accelerations and jerks of every joint over eight decades: few terms matter at a time."""
    nearest = 0.0
    for seed in range(50):
        arm = sparse_chain(seed)
        generator = torch.Generator().manual_seed(seed)
        q = random_states(arm, 300, seed)[0]
        draw = torch.rand(2, 3, 300, 3, generator=generator, dtype=torch.float64)
        dq, ddq, jerk = (10 ** (8 * draw[0] - 4) * (draw[1] - 0.5).sign()).unbind()
        _, rate = jvp(RigidBody(arm).torque, (q, dq, ddq), (dq, ddq, jerk))
        still = torch.zeros_like(q)
        bound = torque_bounds(arm, CellMotion(still, still, dq.abs(), ddq.abs(), jerk.abs(), still))[0]
        share = rate.abs() / bound.clamp_min(1e-300)
        assert share.max() <= 1 + ROUNDING
        nearest = max(nearest, float(share.max()))
    assert nearest > 0.999  # there are states where the bound is sharp


@pytest.mark.parametrize("chain", CHAINS, indirect=True)
def test_no_point_of_a_capsule_moves_faster_than_its_reach(chain: Arm) -> None:
    q = random_states(chain, 200)[0].T.contiguous()
    reach = capsule_reach(chain)
    for joint in range(chain.joints):
        push = torch.zeros_like(q)
        push[joint] = 1.0
        _, speeds = jvp(lambda x: capsule_axes(chain, x), q, push)
        fastest = torch.stack([x.norm(dim=0).amax(1) for x in speeds]).amax(0)
        assert (fastest <= reach[:, joint] + ROUNDING).all()
        own = chain.capsules.link == joint  # one joint away the bound is exact
        torch.testing.assert_close(fastest[own], reach[own, joint])


@settings(max_examples=30, deadline=None)
@given(
    order=st.sampled_from(sorted(HIGHER.values())),
    seed=st.integers(0, 1000),
    harmonics=st.integers(1, 8),
    half=st.sampled_from([0.1, 0.02, 1e-3]),
    centre=st.floats(0, 1),
)
def test_no_derivative_drifts_further_in_a_cell_than_its_bound(order, seed, harmonics, half, centre):
    trajectory = Trajectory(3, harmonics, 3.0)
    c = drawn(trajectory, 6, seed)
    middle = half + centre * (3.0 - 2 * half)
    times = (middle + half * torch.linspace(-1, 1, 41, dtype=torch.float64)).clamp(0, 3.0)
    x = trajectory.derivative(c, times, order)
    change = (x - x[:, 20:21]).abs().amax(1)
    bound = derivative_bound(trajectory, c, order + 2)
    rate = trajectory.derivative(c, times[20:21], order + 1)[:, 0]
    assert (change <= drift(rate, bound, half) * (1 + 1e-9) + 1e-9).all()
