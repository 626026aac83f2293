"""Randomised plants: MuJoCo moves them, each misfit is a switch, and one seed gives one plant.

Hysteresis by the laws that make it one: what counts is the order of reversals, not their times.
"""

from dataclasses import replace
from itertools import pairwise

import mujoco
import numpy as np
import pytest

from sidegan.errors import InfeasibleError, ShapeError
from sidegan.kernels.friction import friction_torque
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.plant import mujoco_model
from sidegan.plant.recorded import Sensors, recorded
from sidegan.plant.varied import RADII, VariedPlant, VariedSettings, lagging
from sidegan.robot import load_robot
from tests.oracle import mujoco_torque
from tests.plant.conftest import motions
from tests.refusals import refused

OFF = dict.fromkeys(("stribeck", "load", "asymmetry", "position", "ripple"), 0.0)
SENSORS = ("compliance", "backlash", "encoder", "resolution", "delay", "hysteresis", "offset")
USUAL = VariedSettings()
# Friction of one law alone, sensors without errors.
PLAIN = replace(
    USUAL, friction=replace(USUAL.friction, **OFF), bearings=(0.0, 0.0), **dict.fromkeys(SENSORS, 0.0)
)


@pytest.fixture(scope="module")
def motion(planar):
    return motions(planar, 3, rate=500.0)


def plant(arm, settings, seed=3):
    return VariedPlant(arm, settings, np.random.SeedSequence(seed))


@pytest.fixture(scope="module")
def plain(planar, motion):
    """Positions and torques that a plant of one friction law and exact sensors measures."""
    return plant(planar, PLAIN).follow(motion)


def ahead(made, motion):
    """Torques that the servos feed forward."""
    return RigidBody(made.arm).torque(*motion[1:]) + made.rotor * motion.acceleration


def simulated(made, motion):
    """Positions, velocities and accelerations of a plant's steps along a motion, motor torques and loads."""
    q, motor, load = made.simulate(motion.position, motion.velocity, ahead(made, motion))
    end = np.diff(q, axis=1) * made.settings.rate  # semi-implicit steps: the speed at the end of each
    return q[:, 1:-1], end[:, :-1], np.diff(end, axis=1) * made.settings.rate, motor[:, 1:-1], load[:, 1:-1]


def inverse(arm, *states):
    """MuJoCo's own inverse dynamics of an arm's links alone, (B, T, J)."""
    model = mujoco_model(arm)
    model.opt.disableflags |= int(mujoco.mjtDisableBit.mjDSBL_CONSTRAINT)
    rows = (x.reshape(-1, arm.joints) for x in states)
    return mujoco_torque(model, *rows).reshape(states[0].shape)


@pytest.mark.parametrize("name", ["planar2", "kuka_lwr4"])
def test_an_ideal_link_sensor_measures_the_torque_on_the_true_links(name):
    arm = load_robot(name)
    made, motion = plant(arm, PLAIN), motions(arm, 2, rate=500.0)
    assert np.abs(made.true.inertial_parameters - arm.inertial_parameters).max() > 0.01
    *states, motor, _ = simulated(made, motion)
    told, links = made.follow(motion)[1][:, 1:-1], inverse(made.true, *states)
    np.testing.assert_allclose(told, links, rtol=0, atol=1e-5)  # N·m
    assert (np.abs(told - motor) > 0.05 * made.scale).any((0, 1)).all()  # gears and rotors take their part
    rubbing = plant(arm, replace(PLAIN, bearings=(0.003, 0.013)))
    *states, _, load = simulated(rubbing, motion)
    lost = load - inverse(made.true, *states)
    expected = friction_torque(*states[:2], np.zeros(1), rubbing.bearings, slice(None))
    np.testing.assert_allclose(lost, expected, rtol=0, atol=1e-5)
    assert np.median(np.abs(lost), (0, 1)) == pytest.approx(rubbing.bearings.coulomb, rel=0.9)


def test_an_ideal_motor_sensor_measures_the_torque_of_the_motors(planar, motion):
    made = plant(planar, replace(PLAIN, sensor="motor"))
    np.testing.assert_array_equal(made.follow(motion)[1][:, 1:-1], simulated(made, motion)[3])


def test_sensor_errors_stay_within_the_stated_size(planar, motion, plain):
    _, exact = plain
    for name, share, most in (("hysteresis", 0.01, 0.01), ("offset", 0.02, 0.02), ("resolution", 4e-3, 2e-3)):
        made = plant(planar, replace(PLAIN, **{name: share}))
        error = np.abs(made.follow(motion)[1] - exact).max((0, 1)) / planar.torque_limit
        assert (error > 0).all() and (error <= most * (1 + 1e-9)).all(), name


def test_one_seed_is_one_plant(planar, motion):
    first, again = (plant(planar, USUAL) for _ in range(2))
    assert np.array_equal(first.follow(motion)[1], again.follow(motion)[1])
    assert not np.array_equal(plant(planar, USUAL, seed=4).law.coulomb, first.law.coulomb)


@pytest.mark.parametrize("switch", [*OFF, *SENSORS, "bearings", "sensor"])
def test_every_misfit_has_its_own_switch(planar, motion, plain, switch):
    if switch in OFF:
        size = getattr(USUAL.friction, switch)
        changed = replace(PLAIN, friction=replace(PLAIN.friction, **{switch: size}))
    else:
        size = "motor" if switch == "sensor" else getattr(USUAL, switch)
        changed = replace(PLAIN, **{switch: size})
    other = plant(planar, changed).follow(motion)
    assert any(np.abs(a - b).max() > 1e-6 for a, b in zip(plain, other))


def test_servos_and_friction_follow_their_laws(planar, motion):
    """The law of friction at every step, given the load of the step before; the servos give the rest."""
    made = plant(planar, USUAL)
    q, dq, acceleration, motor, load = simulated(made, motion)
    lost = motor - load - made.rotor * acceleration
    expected = friction_torque(q[:, 1:], dq[:, 1:], load[:, :-1], made.law, slice(None))
    np.testing.assert_allclose(lost[:, 1:], expected, rtol=0, atol=1e-6 * np.abs(expected).max())
    wanted, speed = motion.position[:, 1:-1], motion.velocity[:, 1:-1]
    stiffness, damping = made.gains
    servo = ahead(made, motion)[:, 1:-1] + stiffness * (wanted - q) + damping * (speed - dq)
    limit = planar.torque_limit
    np.testing.assert_allclose(motor, servo.clip(-limit, limit), rtol=0, atol=1e-6 * np.abs(motor).max())


@pytest.mark.parametrize("correlation", [1e-6, 0.05])
def test_recorded_noise_has_the_stated_size_and_correlation(planar, correlation):
    family = Trajectory(2, 3, 10.0)
    sensors = Sensors(noise=0.1, correlation=correlation, cutoff=20.0, rate=100.0)
    made, c = plant(planar, PLAIN), np.zeros((4, 2, 3, 2))
    c[..., 0, 0] = 0.3
    exact, noisy = (recorded(made, family, c, sensors, random) for random in (None, np.random.default_rng(0)))
    assert all(np.array_equal(*pair) for pair in zip(exact[:3], noisy[:3]))
    noise = (noisy[3] - exact[3]) / made.range
    keep = np.exp(-1 / (100.0 * correlation))
    assert noise.std() == pytest.approx(0.1, rel=0.1)
    assert (noise[:, 1:] * noise[:, :-1]).mean() / noise.var() == pytest.approx(keep, abs=0.05)
    for below, above in pairwise(exact[:3]):
        slope = np.gradient(below, 1 / sensors.rate, axis=1)
        assert np.abs((slope - above)[:, 50:-50]).max() < 0.02 * np.abs(above).max()


def test_untrackable_motions_and_other_rates_are_refused(planar, motion):
    with refused(InfeasibleError):
        plant(planar, replace(USUAL, tolerance=1e-9)).follow(motion)
    with refused(ShapeError, "500 Hz"):
        plant(planar, USUAL).follow(motions(planar, rate=100.0))


FULL, SHARE = np.array([100.0, 20.0]), 0.01  # N·m of two joints
WEIGHT = SHARE / RADII.sum()


def path(turns, steps=1000):
    """A load from zero by way of these shares of the range, (1, T, 2), and where each is reached."""
    legs = [np.linspace(a, b, steps + 1)[1:] for a, b in zip((0.0, *turns), turns)]
    return np.concatenate([[0.0], *legs])[None, :, None] * FULL, steps * np.arange(1, len(turns) + 1)


def area(load, told):
    """Area of the closed loop that load and told make, (J,), as a share of the range's square."""
    lag = (load - told)[0]
    return np.abs(np.trapezoid(lag, load[0], axis=0)) / FULL**2


@pytest.mark.parametrize("swing", [0.1, 0.2, 0.7, 1.0])
def test_the_loop_area_is_that_of_the_elements_at_any_speed(swing):
    """A stop of radius r holds a parallelogram of area 4 r (A − r) of a swing ±A, none where A is smaller."""
    load, (start, _, end) = path((swing, -swing, swing))
    told = lagging(load, FULL, SHARE)
    expected = WEIGHT * sum(4 * r * max(swing - r, 0) for r in RADII)
    slow = slice(start, end + 1)
    assert area(load[:, slow], told[:, slow]) == pytest.approx([expected] * 2, rel=0.01, abs=1e-12)
    bent = np.linspace(0, 1, 4001) ** 2 * (len(load[0]) - 1)  # the same way, ever faster
    kept = np.unique(np.append(np.round(bent), (start, end, 2 * start))).astype(int)
    np.testing.assert_allclose(lagging(load[:, kept], FULL, SHARE), told[:, kept], rtol=0, atol=1e-9)


def test_a_larger_swing_erases_the_memory_of_smaller_ones():
    direct, _ = path((0.9, -0.9, 0.3))
    history, _ = path((0.4, -0.2, 0.9, 0.1, 0.5, -0.9, 0.3))
    told = [lagging(load, FULL, SHARE)[0, -1] for load in (direct, history)]
    np.testing.assert_allclose(*told, rtol=1e-12)
    minor, (first, _, last) = path((0.6, 0.1, 0.6))  # a minor loop closes where it began
    inner = lagging(minor, FULL, SHARE)[0]
    np.testing.assert_allclose(inner[first], inner[last], rtol=1e-12)


def test_the_full_range_loop_has_the_stated_width():
    load, (top, bottom, end) = path((1.0, -1.0, 1.0))
    told = lagging(load, FULL, SHARE)[0]
    for sign, zero in ((1, (top + bottom) // 2), (-1, (bottom + end) // 2)):  # on the way down and up
        np.testing.assert_allclose(load[0, zero], 0, atol=1e-9)
        np.testing.assert_allclose(told[zero], sign * SHARE * FULL, rtol=1e-9)
    walk = np.random.default_rng(0).uniform(-1, 1, (3, 200, 2)) * FULL
    assert (np.abs(lagging(walk, FULL, SHARE) - walk) <= SHARE * FULL * (1 + 1e-12)).all()
    np.testing.assert_array_equal(lagging(walk, FULL, 0.0), walk)
