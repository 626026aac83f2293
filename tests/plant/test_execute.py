"""What the plant does follows the equations of motion; what it records and refuses."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import ConfigError, InfeasibleError, RobotError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import concatenate
from sidegan.plant import IDEAL, Plant, PlantSettings, mujoco_model, save_recording
from sidegan.recording.load import load_recording
from tests.chains import random_chain, real_links
from tests.plant.conftest import motions
from tests.recording.conftest import of_file
from tests.refusals import refused

RATE = 1000.0  # Hz


def accelerations(executed):
    return np.diff(executed.velocity, axis=0) * RATE


def rigid(arm, executed):
    """The torque that accelerated the links, (T − 1, J)."""
    states = executed.position[:-1], executed.velocity[:-1], accelerations(executed)
    return RigidBody(arm).torque(*states)


def rms(x):
    return np.sqrt(np.square(x).mean())


@pytest.mark.parametrize("joints", [1, 4, 7])
def test_any_chain_obeys_its_equations_of_motion(joints):
    own = {"inertial_parameters": real_links(joints, 1), "torque_limit": np.full(joints, np.inf)}
    arm = replace(random_chain(joints, 1)[0], **own)
    settings = replace(IDEAL, viscous=[1.5], rotor_inertia=[0.3])
    executed = Plant(arm, settings).follow(motions(arm))
    wanted = rigid(arm, executed) + 0.3 * accelerations(executed) + 1.5 * executed.velocity[1:]
    np.testing.assert_allclose(executed.torque[:-1], wanted, rtol=0, atol=1e-8)


def test_a_saturated_drive_obeys_the_equations_of_motion(planar):
    motion = motions(planar)
    most = np.abs(Plant(planar, IDEAL).follow(motion).torque).max(0)
    weak = replace(planar, torque_limit=0.97 * most)
    executed = Plant(weak, replace(IDEAL, tolerance=1.0)).follow(motion)
    assert ((np.abs(executed.torque) >= 0.97 * most).sum(0) > 10).all()
    assert (np.abs(executed.torque).max(0) < 0.975 * most).all()
    np.testing.assert_allclose(executed.torque[:-1], rigid(weak, executed), rtol=0, atol=1e-8)


def test_coulomb_friction_is_constant_and_against_the_motion(arm):
    coulomb = np.linspace(0.3, 5.0, 7)
    settings = replace(IDEAL, coulomb=coulomb.tolist(), rotor_inertia=[0.5])
    executed = Plant(arm, settings).follow(motions(arm))
    friction = executed.torque[:-1] - rigid(arm, executed) - 0.5 * accelerations(executed)
    speed = executed.velocity[1:]
    assert (np.abs(friction) <= coulomb + 1e-6).all()
    for j in range(7):
        moving = np.abs(speed[:, j]) > 0.05
        assert moving.any()
        sign = np.sign(speed[moving, j])
        np.testing.assert_allclose(friction[moving, j], sign * coulomb[j], rtol=0.01, atol=0)


def test_less_feed_forward_means_worse_tracking(arm):
    motion = motions(arm, period=8.0)
    known = [replace(IDEAL, feed_forward=share) for share in (1.0, 0.9, 0.5)]
    exact, less, least, usual = (
        Plant(arm, settings).follow(motion).position - motion.position[0]
        for settings in (*known, PlantSettings())
    )
    assert np.abs(exact).max() < 1e-4 < rms(usual) < 1e-2
    assert rms(exact) < rms(less) < rms(least)


def test_motions_are_executed_one_after_another(planar):
    several, plant = motions(planar, count=3, period=2.0), Plant(planar, PlantSettings())
    executed = plant.follow(several)
    assert executed.time.shape == (6001,)
    assert all(map(np.array_equal, executed, plant.follow(concatenate(several))))


def test_a_saved_recording_is_read_back_by_the_recording_package(planar, tmp_path):
    executed = Plant(planar, IDEAL).execute(motions(planar, period=1.0), 0, 0.1)
    path = tmp_path / "plant.parquet"
    save_recording(executed, planar.joint_names, path)
    read = load_recording(path, of_file(), planar.joint_names)
    assert not read.corrupt and read.acceleration is None
    for name, values in executed._asdict().items():
        assert np.array_equal(getattr(read, name), values), name


@pytest.mark.parametrize("names", [("a",), ("a", "b", "c")])
def test_a_recording_is_saved_only_with_a_name_for_each_joint(planar, tmp_path, names):
    executed = Plant(planar, IDEAL).follow(motions(planar, period=1.0))
    with refused(ShapeError, "joint_names", "2 joints"):
        save_recording(executed, names, tmp_path / "plant.parquet")


def test_torque_noise_has_the_stated_size_and_follows_the_seed(planar):
    plant, motion = Plant(planar, IDEAL), motions(planar, period=16.0)
    true = plant.follow(motion)
    first, same, other = (plant.execute(motion, seed, 0.5) for seed in (1, 1, 2))
    assert np.array_equal(first.position, true.position)
    assert np.array_equal(first.torque, same.torque) and not np.array_equal(first.torque, other.torque)
    noise = first.torque - true.torque  # 16,001 samples
    assert noise.std(0).tolist() == pytest.approx([0.5, 0.5], rel=0.03)


def links(*changes):
    """Change link parameters of an arm: link, parameter and factor."""

    def change(arm):
        parameters = arm.inertial_parameters.copy()
        for link, parameter, factor in changes:
            parameters[link, parameter] *= factor
        return replace(arm, inertial_parameters=parameters)

    return change


def weak(arm):
    return replace(arm, torque_limit=np.array([200.0, 1.0]))


def same(arm):
    return arm


LOOSE = {"bandwidth": [0.2], "feed_forward": 0.0, "tolerance": 0.01}
WILD = {"bandwidth": [800.0], "damping_ratio": [0.05]}
THIN, LIGHT = links((0, slice(4, 10), 0.1)), links((slice(None), slice(None), 1e-17))
REFUSED = [  # the error, the names in it, what is changed of the arm, and settings
    (InfeasibleError, ["'elbow'", "0.1 rad", "1 N·m"], weak, {}),
    (InfeasibleError, ["0.01 rad"], same, LOOSE),
    (InfeasibleError, ["0.1 rad"], same, WILD),
    (RobotError, ["'upper_arm'"], THIN, {}),
    (RobotError, ["MuJoCo", "planar2"], LIGHT, {}),
    (ShapeError, ["0.001 s", "0.01 s", "100 Hz"], same, {"rate": 100.0}),
    (ConfigError, ["plant.viscous", "3", "2"], same, {"viscous": [0.1] * 3}),
]


@pytest.mark.parametrize(("error", "names", "make", "settings"), REFUSED)
def test_invalid_executions_are_refused(planar, error, names, make, settings):
    with refused(error, *names):
        Plant(make(planar), replace(IDEAL, **settings)).follow(motions(planar))


def test_motions_of_another_arm_and_those_not_finite_are_refused(arm, planar):
    motion = motions(planar)
    with refused(ShapeError, "position", "(1, 4001, 2)", "(B, 4001, 7)"):
        Plant(arm, IDEAL).follow(motion)
    motion.velocity[0, 5, 1] = np.nan
    with refused(ShapeError, "velocity"):
        Plant(planar, IDEAL).follow(motion)


def test_impossible_links_are_named(arm):
    with refused(RobotError, "'link_2'", "0 kg", "'link_5'"):
        mujoco_model(links((1, 0, 0.0), (4, 0, -1.0))(arm))
