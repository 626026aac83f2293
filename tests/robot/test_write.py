"""A written description reads as the same arm with the new inertias: for us, Pinocchio and MuJoCo."""

import xml.etree.ElementTree as ET
from functools import partial

import mujoco
import numpy as np
import pinocchio as pin
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sidegan.motion.dynamics import RigidBody
from sidegan.robot import (
    Drives,
    Limits,
    Setup,
    built_in_robots,
    load_robot,
    torque_of_mjcf,
    torque_of_urdf,
    write_mjcf,
    write_urdf,
)
from tests.chains import random_states, real_links
from tests.oracle import pinocchio_torque
from tests.recording.conftest import real

from .urdf import INERTIA, joint, link, more, one_joint, robot


def drives(joints):
    """Viscous, Coulomb and rotors that tell the joints apart."""
    return Drives(*(x + np.arange(joints, dtype=float) / 10 for x in (0.5, 1.0, 0.2)))


def assert_written(arm, path):
    """An arm's torques are its file's by Pinocchio, and with other links those of what is written."""
    parameters, states = real_links(arm.joints, 0), random_states(arm, 50)
    write_urdf(arm, parameters, path)
    read = load_robot(path)
    expected = RigidBody(arm).regressor(*states) @ parameters.ravel()
    np.testing.assert_allclose(RigidBody(read).torque(*states), expected, rtol=0, atol=1e-9)
    for same in (arm, read):
        expected = pinocchio_torque(pin.buildModelFromUrdf(str(same.urdf)), *states)
        np.testing.assert_allclose(RigidBody(same).torque(*states), expected, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", [*built_in_robots(), "ur10e/reference.urdf"])
def test_writing_changes_only_inertias_and_reads_back_to_the_same_torques(name, tmp_path):
    arm = load_robot(name if name in built_in_robots() else real(name))
    assert_written(arm, tmp_path / "out.urdf")
    before, after = (ET.parse(path).getroot() for path in (arm.urdf, tmp_path / "out.urdf"))
    for inertial in (element for root in (before, after) for element in root.iter("inertial")):
        inertial.clear()
    one, other = (ET.canonicalize(ET.tostring(root), strip_text=True) for root in (before, after))
    assert one == other


numbers = st.floats(-2, 2, allow_subnormal=False)
vectors = st.tuples(numbers, numbers, numbers)
kinds = st.sampled_from(["revolute", "prismatic", "fixed"])
axes = vectors.filter(lambda v: np.linalg.norm(v) > 0.1)
inertias = st.sampled_from([INERTIA, "", "<!-- > -->"])


@settings(max_examples=40, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(
    st.lists(st.tuples(kinds, vectors, vectors, axes, inertias), min_size=1, max_size=9).filter(
        lambda chain: any(kind != "fixed" for kind, *_ in chain)
    )
)
def test_any_chain_reads_and_writes_as_pinocchio_does(load, tmp_path, chain):
    def words(v):
        return " ".join(map(repr, v))

    parts = [link("l0", "")]
    for i, (kind, xyz, rpy, axis, inertia) in enumerate(chain):
        origin, axis = f'xyz="{words(xyz)}" rpy="{words(rpy)}"', words(axis)
        parts += [joint(f"j{i}", f"l{i}", f"l{i + 1}", kind, origin, axis), link(f"l{i + 1}", inertia)]
    arm = load(robot(*parts))
    moving = [kind for kind, *_ in chain if kind != "fixed"]
    assert arm.prismatic.tolist() == [kind == "prismatic" for kind in moving]
    np.testing.assert_allclose(np.linalg.norm(arm.axis, axis=1), np.ones(arm.joints))
    assert_written(arm, tmp_path / "out.urdf")


def test_comments_extra_elements_and_unicode_are_kept(load, tmp_path):
    extra = '<!-- <inertial> größer > kleiner --><gazebo reference="arm"><inertial/></gazebo>'
    arm = load('<?xml version="1.0" encoding="utf-8"?>' + more(one_joint(), extra))
    assert_written(arm, tmp_path / "out.urdf")
    written = (tmp_path / "out.urdf").read_text(encoding="utf-8")
    assert "<!-- <inertial> größer > kleiner -->" in written
    assert '<gazebo reference="arm"><inertial />' in written


@pytest.mark.parametrize("lower", [0, 1])  # as SolidWorks exports joints, and the wrong way round
def test_impossible_limits_give_way_to_the_users_when_written(load, tmp_path, lower):
    text = one_joint(limit=f'<limit lower="{lower}" upper="0" velocity="-1" effort="1"/>')
    arm = load(text, Setup(limits=Limits(position={"turn": (-1.0, 2.0)}, velocity=3.0)))
    write_urdf(arm, arm.inertial_parameters, tmp_path / "out.urdf")
    read = load_robot(tmp_path / "out.urdf")
    assert (read.position_lower, read.position_upper, read.velocity_limit) == (-1, 2, 3)


@pytest.mark.parametrize("effort", [None, 9.0])
def test_a_limit_without_effort_is_written_as_other_readers_require_it(load, tmp_path, effort):
    text = one_joint(limit='<limit lower="-1" upper="1" velocity="1"/>')
    arm = load(text, Setup(limits=Limits(effort=effort)))
    write_urdf(arm, arm.inertial_parameters, tmp_path / "out.urdf")
    assert pin.buildModelFromUrdf(str(tmp_path / "out.urdf")).upperEffortLimit.tolist() == [effort or 0.0]


def test_written_friction_replaces_dynamics_and_is_never_negative(load, tmp_path):
    known = joint("j0", "l0", "l1", extra='<dynamics damping="9"/>')
    arm = load(robot(*(link(f"l{i}", INERTIA) for i in range(3)), known, joint("j1", "l1", "l2")))
    own = np.array([[0.5, 0.25], [1.5, 2.5], [0.1, 0.1]])
    for sign in ([1.0, 1.0], [1.0, -1.0]):
        write_urdf(arm, real_links(2, 0), tmp_path / "out.urdf", Drives(*(own * np.array(sign))))
        model = pin.buildModelFromUrdf(str(tmp_path / "out.urdf"))
        assert model.damping.tolist() == [0.5, max(0.0, 0.25 * sign[1])]
        assert model.upperDryFrictionLimit.tolist() == [1.5, max(0.0, 2.5 * sign[1])]
        assert (tmp_path / "out.urdf").read_text().count("<dynamics") == 2


def test_files_of_a_mounted_arm_with_a_locked_joint_give_its_torques(tmp_path):
    """Shapes of what is fixed to a link add no mass to it; states are beyond the ranges."""
    arm = load_robot("kuka_lwr4", Setup(mount=(0.3, 0.2, 0.1), locked={"joint_3": 0.4}))
    own, (q, dq, ddq) = drives(arm.joints), random_states(arm, 20)
    states = q + 3.0, np.copysign(np.maximum(np.abs(dq), 1.0), dq), ddq
    write_urdf(arm, arm.inertial_parameters, tmp_path / "a.urdf", own)
    write_mjcf(arm, arm.inertial_parameters, tmp_path / "a.xml", own)
    expected = RigidBody(arm).torque(*states) + own.torque(*states[1:])
    found = torque_of_mjcf(tmp_path / "a.xml", *states)
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)
    found = torque_of_urdf(tmp_path / "a.urdf", arm, *states) + own.rotor_inertia * ddq
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-9)


def test_torques_at_whole_numbers_are_not_rounded_and_of_no_states_are_none(planar, tmp_path):
    """Files are named, and parameters given, as users have them."""
    urdf, mjcf = str(tmp_path / "a.urdf"), str(tmp_path / "a.xml")
    write_urdf(planar, planar.inertial_parameters.tolist(), urdf)
    write_mjcf(planar, planar.inertial_parameters.tolist(), mjcf, Drives.none(2))
    whole, none = [[1, 2], [3, 4]], np.zeros((0, 2))
    expected = RigidBody(planar).torque(*[np.array(whole, float)] * 3)
    for read in (lambda *x: torque_of_urdf(urdf, planar, *x), partial(torque_of_mjcf, mjcf)):
        np.testing.assert_allclose(read(whole, whole, whole), expected, rtol=0, atol=1e-9)
        assert read(none, none, none).shape == (0, 2)


def test_an_mjcf_with_negative_friction_can_be_read(planar, tmp_path):
    write_mjcf(planar, planar.inertial_parameters, tmp_path / "a.xml", Drives([-1, 2], [3, -4], [0, -0.1]))
    drives = load_robot(tmp_path / "a.xml", {"limits": {"velocity": 1.0}}).drives
    assert [x.tolist() for x in vars(drives).values()] == [[0, 2], [3, 0], [0, 0]]


@pytest.mark.parametrize("name", built_in_robots())
def test_three_engines_read_the_same_arm_from_mjcf(name, tmp_path):
    arm, path = load_robot(name), tmp_path / "arm.xml"
    links, own = real_links(arm.joints, 0), drives(arm.joints)
    write_mjcf(arm, links, path, own)
    q, dq, ddq = random_states(arm, 20)
    # near rest MuJoCo's dry friction follows the acceleration
    dq = np.copysign(np.maximum(np.abs(dq), 1.0), dq)
    states = q, dq, ddq
    rigid = RigidBody(arm).regressor(*states) @ links.ravel()
    fast = Setup(limits=Limits(velocity=dict.fromkeys(arm.joint_names, 1.0)))  # MJCF has no place for them
    np.testing.assert_allclose(RigidBody(load_robot(path, fast)).torque(*states), rigid, rtol=0, atol=1e-9)
    model, other = pin.buildModelFromMJCF(str(path)), mujoco.MjModel.from_xml_path(str(path))
    with_rotors = rigid + own.rotor_inertia * ddq
    whole = with_rotors + own.viscous * dq + own.coulomb * np.sign(dq)
    np.testing.assert_allclose(pinocchio_torque(model, *states), with_rotors, rtol=0, atol=1e-9)
    np.testing.assert_allclose(torque_of_mjcf(path, *states), whole, rtol=0, atol=1e-9)
    np.testing.assert_allclose(model.upperPositionLimit, arm.position_upper, rtol=0, atol=1e-12)
    assert other.ngeom == len(arm.capsules.link) and np.all(other.geom_contype & other.geom_conaffinity)
    assert [other.joint(i).name for i in range(arm.joints)] == list(arm.joint_names)


def test_a_joint_at_rest_has_no_friction():
    """Whatever the rounding of its velocity."""
    drives = Drives(np.zeros(1), np.ones(1), np.zeros(1))
    assert drives.torque(np.array([[-1e-15], [0.0], [1e-3]]), np.zeros((3, 1))).ravel().tolist() == [0, 0, 1]
