"""Generators of arms with limits of acceleration and jerk."""

from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.errors import ShapeError
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.labels import scaled_margins
from sidegan.gan.limits import LimitLayer
from sidegan.gan.networks import Generator
from sidegan.gan.rollout import RollOut
from sidegan.gan.scaling import Scaling
from sidegan.gan.surrogates import SuccessPredictor
from sidegan.gan.training import random_trajectories
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER, load_robot
from sidegan.validity import Constraints, check
from tests.validity.critical import limited

ARM = load_robot("planar2")
BOTH = ["acceleration", "jerk"]


def draw(family, seed, scale, count=8):
    return scale * torch.randn(count, *family.shape, generator=torch.Generator().manual_seed(seed))


@settings(deadline=None, max_examples=30)
@given(
    names=st.sets(st.sampled_from(BOTH), min_size=1),
    seed=st.integers(0, 10_000),
    scale=st.floats(-4, 4),
    share=st.floats(-3, 1),
    period=st.floats(1, 60),
    harmonics=st.integers(1, 8),
)
def test_whatever_comes_in_the_limits_hold_all_the_time(names, seed, scale, share, period, harmonics):
    family, arm = Trajectory(2, harmonics, period, (0.3, -0.2)), limited(ARM, sorted(names), 10**share)
    c = LimitLayer.of(arm, family)(draw(family, seed, 10**scale)).double()
    margins = check(Constraints(arm, torque=False), family, c).margins
    for name in ("position", "velocity", *names):
        clear = margins[name] >= 0
        assert clear.all(), name


def test_all_of_the_tightest_limit_can_be_used_and_sampling_finds_no_more():
    family, arm = Trajectory(2, 4, 8.0), limited(ARM, BOTH, 0.05)
    layer = LimitLayer.of(arm, family)
    c = layer(draw(family, 0, 100.0))
    used = layer.use(c)
    assert (used <= 1).all() and (used > 0.999).all()
    times = torch.linspace(0, 8, 20_001, dtype=torch.float64)
    shares = [
        family.derivative(c.double(), times, HIGHER[name]).abs().amax(1) / limit
        for name, limit in arm.higher_limits.items()
    ]
    most = torch.stack(shares).amax(0)
    assert (most <= 1).all() and (most > 0.95).all()


def test_limits_of_another_shape_are_refused():
    family = Trajectory(2, 4, 8.0)
    with pytest.raises(ShapeError, match="room"):
        LimitLayer(family, torch.ones(2, 2), torch.ones(2), {"jerk": torch.ones(3)})


@pytest.fixture(scope="module")
def generator():
    family, arm = Trajectory(2, 3, 8.0), limited(ARM, BOTH, 0.1)
    start = random_trajectories(Constraints(arm), family, 0)
    torch.manual_seed(0)
    network = Generator(2, 3, 10, "mlp", 16, True)
    scaling = Scaling.fit(start)
    network.start_from(scaling.image(start))
    layer = LimitLayer.of(arm, family)
    return arm, TrajectoryGenerator(network.eval(), scaling, family, arm.name, arm.digest, "exact", layer)


def test_a_saved_generator_keeps_the_limits_to_the_last_bit(generator, tmp_path):
    arm, made = generator
    made.save(tmp_path / "g.pt")
    loaded = TrajectoryGenerator.load(tmp_path / "g.pt", arm)
    assert torch.equal(loaded.sample(30, 1), made.sample(30, 1))
    margins = check(Constraints(arm, torque=False), made.trajectory, loaded.sample(200, 2)).margins
    assert all((margins[name] >= 0).all() for name in ("position", "velocity", *BOTH))


def test_a_generator_of_another_arm_takes_over_its_limits(generator):
    _, made = generator
    tighter = limited(ARM, ["acceleration"], 0.02)
    moved = made.transferred(tighter, made.trajectory)
    margins = check(Constraints(tighter, torque=False), made.trajectory, moved.sample(100, 3)).margins
    assert (margins["acceleration"] >= 0).all()
    c = made.sample(100, 3)
    assert (check(Constraints(tighter), made.trajectory, c).margins["acceleration"] < 0).any()


@pytest.mark.parametrize("names", [["acceleration"], ["jerk"], BOTH])
def test_margins_of_what_is_linear_are_exact(names):
    family, arm = Trajectory(2, 3, 8.0), limited(ARM, names, 0.1)
    constraints, c = Constraints(arm), draw(family, 5, 0.1, 20)
    predictor = SuccessPredictor(arm, family, len(constraints.labels), 8, 400)
    linear = 2 + len(names)
    found = predictor.margins(c)
    assert found.shape[1] == len(constraints.labels)
    assert RollOut(arm, family, 10)(c).shape[1] == 10 + linear
    exact = scaled_margins(constraints, family, c.double(), 400)
    assert exact.shape == found.shape
    for k in range(linear):
        one, other = (x[:, k].amin(1) for x in (found, exact))
        torch.testing.assert_close(one.clamp(-1, 1), other, rtol=0, atol=5e-3)


def test_without_such_limits_nothing_is_added():
    family = Trajectory(2, 3, 8.0)
    assert LimitLayer.of(ARM, family).inverse == {}
    free = replace(ARM, acceleration_limit=torch.full((2,), torch.inf, dtype=torch.float64))
    assert RollOut(free, family, 10).channels == RollOut(ARM, family, 10).channels == 12
