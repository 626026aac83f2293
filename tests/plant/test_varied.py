"""Randomised plants: MuJoCo moves them, each misfit is a switch, and one seed gives one plant."""

from dataclasses import replace
from itertools import pairwise

import numpy as np
import pytest
import torch

from sidegan.errors import InfeasibleError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.plant.recorded import Sensors, recorded
from sidegan.plant.varied import VariedPlant, VariedSettings
from sidegan.robot import load_robot

OFF = dict.fromkeys(("stribeck", "load", "asymmetry", "position", "ripple"), 0.0)
SEED = 3


@pytest.fixture(scope="module")
def settings():
    return VariedSettings()


@pytest.fixture(scope="module")
def plain(settings):
    """Friction of one law alone, sensors without errors."""
    sensors = dict.fromkeys(("compliance", "backlash", "encoder", "resolution", "delay"), 0.0)
    return replace(settings, friction=replace(settings.friction, **OFF), **sensors)


@pytest.fixture(scope="module")
def motion(planar, motions):
    return motions(planar, 3, rate=500.0)


def plant(arm, settings, seed=SEED):
    return VariedPlant(arm, settings, np.random.SeedSequence(seed))


@pytest.mark.parametrize("name", ["planar2", "kuka_lwr4"])
def test_motors_move_the_true_arm_its_rotors_and_friction(name, plain, motions):
    arm = load_robot(name)
    made, motion = plant(arm, plain), motions(arm, 3, rate=500.0)
    assert (made.true.inertial_parameters - arm.inertial_parameters).abs().max() > 0.01
    ahead = RigidBody(arm).torque(*motion[1:]).numpy()
    q, motor, friction = map(
        torch.from_numpy, made._simulate(motion.position.numpy(), motion.velocity.numpy(), ahead)
    )
    before = (q[:, 1:-1] - q[:, :-2]) * plain.rate  # semi-implicit steps: the speed at which a step begins
    acceleration = (q[:, 2:] - 2 * q[:, 1:-1] + q[:, :-2]) * plain.rate**2
    rigid = RigidBody(made.true).torque(q[:, 1:-1], before, acceleration)
    expected = rigid + torch.from_numpy(made.rotor) * acceleration
    torch.testing.assert_close((motor - friction)[:, 1:-1], expected, rtol=0, atol=1e-5)


def test_one_seed_is_one_plant(planar, settings, motion):
    one, again = (plant(planar, settings) for _ in range(2))
    assert np.array_equal(one.follow(motion)[1], again.follow(motion)[1])
    assert not np.array_equal(plant(planar, settings, seed=4).law.coulomb, one.law.coulomb)


@pytest.mark.parametrize("switch", [*OFF, "compliance", "backlash", "delay", "resolution", "encoder"])
def test_every_misfit_is_a_switch_of_its_own(planar, plain, settings, motion, switch):
    if switch in OFF:
        size = getattr(settings.friction, switch)
        changed = replace(plain, friction=replace(plain.friction, **{switch: size}))
    else:
        changed = replace(plain, **{switch: getattr(settings, switch)})
    one, other = (plant(planar, x).follow(motion) for x in (plain, changed))
    assert any(np.abs(a - b).max() > 1e-6 for a, b in zip(one, other))


def test_servos_and_friction_are_what_they_are_said_to_be(planar, settings, motion):
    """The law of friction at every step, given the load of the step before; the servos give the rest."""
    made, rate = plant(planar, settings), settings.rate
    wanted, speed, ahead = (x.numpy() for x in (motion[1], motion[2], RigidBody(planar).torque(*motion[1:])))
    q, motor, friction = made._simulate(wanted, speed.copy(), ahead)
    dq = np.diff(q, axis=1) * rate  # semi-implicit steps: the speed at the end of each
    push, rotor = (motor - friction)[:, 1:-1], made.rotor * np.diff(dq, axis=1) * rate
    expected = made.law(q[:, 2:], dq[:, 1:], push - rotor)
    np.testing.assert_allclose(friction[:, 2:], expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    stiffness, damping = made._gains
    servo = ahead + stiffness * (wanted - q) + damping * (speed - np.insert(dq, 0, speed[:, 0], axis=1))
    limit = planar.torque_limit.numpy()
    scale = np.abs(motor).max()
    np.testing.assert_allclose(motor[:, 1:], servo.clip(-limit, limit)[:, 1:], rtol=0, atol=1e-6 * scale)


@pytest.mark.parametrize("correlation", [1e-6, 0.05])
def test_recorded_noise_has_the_stated_size_and_correlation(planar, plain, correlation):
    family, sensors = (
        Trajectory(2, 3, 40.0),
        Sensors(noise=0.1, correlation=correlation, cutoff=20.0, rate=100.0),
    )
    made, c = plant(planar, plain), torch.zeros(1, 2, 3, 2, dtype=torch.float64)
    c[..., 0, 0] = 0.3
    exact, noisy = (recorded(made, family, c, sensors, random) for random in (None, np.random.default_rng(0)))
    assert all(torch.equal(*pair) for pair in zip(exact[:3], noisy[:3]))
    noise = (noisy[3] - exact[3])[0].numpy() / made.scale
    keep = np.exp(-1 / (100.0 * correlation))
    assert noise.std() == pytest.approx(0.1, rel=0.1)
    assert (noise[1:] * noise[:-1]).mean() / noise.var() == pytest.approx(keep, abs=0.05)
    for below, above in pairwise(exact[:3]):
        slope = torch.gradient(below, spacing=1 / sensors.rate, dim=1)[0]
        assert (slope - above)[:, 50:-50].abs().max() < 0.02 * above.abs().max()


def test_what_cannot_be_followed_or_is_at_another_rate_is_refused(planar, settings, motion, motions):
    with pytest.raises(InfeasibleError, match="do not follow"):
        plant(planar, replace(settings, tolerance=1e-9)).follow(motion)
    with pytest.raises(ShapeError, match="500 Hz"):
        plant(planar, settings).follow(motions(planar, rate=100.0))
