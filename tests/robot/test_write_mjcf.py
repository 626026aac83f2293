"""A written MJCF is the arm: for MuJoCo, for Pinocchio, and read back by us."""

import mujoco
import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.errors import RobotError, ShapeError, StorageError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Drives, Limits, Setup, built_in_robots, load_robot, write_mjcf
from tests.chains import random_states, real_links


def drives(joints):
    """Viscous, Coulomb and rotors that tell the joints apart."""
    return Drives(*(x + torch.arange(joints, dtype=torch.float64) / 10 for x in (0.5, 1.0, 0.2)))


@pytest.mark.parametrize("name", built_in_robots())
def test_three_engines_read_the_same_arm(name, tmp_path):
    arm, path = load_robot(name), tmp_path / "arm.xml"
    links, own = real_links(arm.joints, 0), drives(arm.joints)
    write_mjcf(arm, links, path, own)
    states = random_states(arm, 20)
    _, dq, ddq = states
    rigid = RigidBody(arm).torque(*states, links)
    fast = Setup(limits=Limits(velocity=dict.fromkeys(arm.joint_names, 1.0)))  # MJCF has no place for them
    torch.testing.assert_close(RigidBody(load_robot(path, fast)).torque(*states), rigid, rtol=0, atol=1e-9)
    model, other = pin.buildModelFromMJCF(str(path)), mujoco.MjModel.from_xml_path(str(path))
    data, its = model.createData(), mujoco.MjData(other)
    with_rotors = rigid + own.rotor_inertia * ddq
    whole = with_rotors + own.viscous * dq + own.coulomb * dq.sign()
    for k, state in enumerate(zip(*(x.numpy() for x in states))):
        np.testing.assert_allclose(pin.rnea(model, data, *state), with_rotors[k], rtol=0, atol=1e-9)
        its.qpos[:], its.qvel[:], its.qacc[:] = state
        mujoco.mj_inverse(other, its)
        np.testing.assert_allclose(its.qfrc_inverse, whole[k], rtol=0, atol=1e-9)
    np.testing.assert_allclose(model.upperPositionLimit, arm.position_upper, rtol=0, atol=1e-12)
    assert other.ngeom == (arm.capsules.link >= 0).sum()
    assert [other.joint(i).name for i in range(arm.joints)] == list(arm.joint_names)


def test_links_that_cannot_exist_are_refused(planar, tmp_path):
    with pytest.raises(RobotError, match="not physically consistent"):
        write_mjcf(planar, -planar.inertial_parameters, tmp_path / "arm.xml", Drives.none(2))
    assert not (tmp_path / "arm.xml").exists()


def test_what_mujoco_refuses_is_not_left_behind(planar, tmp_path):
    with pytest.raises(RobotError, match="MuJoCo refuses planar2"):
        write_mjcf(planar, 1e-20 * planar.inertial_parameters, tmp_path / "arm.xml", Drives.none(2))
    assert not (tmp_path / "arm.xml").exists()


def test_a_place_that_cannot_be_written_is_named(planar, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot write"):
        write_mjcf(planar, planar.inertial_parameters, tmp_path / "file" / "arm.xml", Drives.none(2))


def test_friction_and_rotors_of_another_arm_are_refused():
    with pytest.raises(ShapeError, match="one number per joint"):
        Drives(torch.zeros(2), torch.zeros(3), torch.zeros(2))
