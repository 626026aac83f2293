"""A written URDF reads as the same arm with the new inertias, and is else the text it was."""

import difflib
import re

import numpy as np
import pinocchio as pin
import pytest
import torch
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st

from sidegan.errors import RobotError, ShapeError, StorageError
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Drives, built_in_robots, load_robot, pinocchio_model, write_urdf
from tests.chains import random_states, real_links

from .urdf import INERTIA, joint, link, one_joint, robot


def assert_same_torques(arm, parameters, path):
    """The file's torques, by us and by Pinocchio, are those of the arm with these parameters."""
    states = random_states(arm, 50)
    wanted = RigidBody(arm).torque(*states, parameters)
    read = load_robot(path)
    torch.testing.assert_close(RigidBody(read).torque(*states), wanted, rtol=0, atol=1e-9)
    model = pinocchio_model(read)
    data = model.createData()
    for row, *state in zip(wanted.numpy(), *(x.numpy() for x in states)):
        np.testing.assert_allclose(pin.rnea(model, data, *state), row, rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", built_in_robots())
@pytest.mark.parametrize("seed", range(3))
def test_what_is_written_reads_back_to_the_same_torques(name, seed, tmp_path):
    arm = load_robot(name)
    parameters = real_links(arm.joints, seed)
    write_urdf(arm, parameters, tmp_path / "identified.urdf")
    assert_same_torques(arm, parameters, tmp_path / "identified.urdf")


@pytest.mark.parametrize("name", built_in_robots())
def test_only_inertias_change(name, tmp_path):
    arm = load_robot(name)
    write_urdf(arm, real_links(arm.joints, 0), tmp_path / "identified.urdf")
    before = arm.urdf.read_text(encoding="utf-8").splitlines()
    after = (tmp_path / "identified.urdf").read_text(encoding="utf-8").splitlines()
    changed = [line[2:].strip() for line in difflib.ndiff(before, after) if line[:2] in ("+ ", "- ")]
    tags = {re.split("[ =]", line)[0] for line in changed if line}
    assert tags == {"<mass", "<origin", "<inertia", "iyy"}


def test_friction_goes_where_dynamics_are_or_should_be(load, tmp_path):
    known = joint("j0", "l0", "l1").replace("</joint>", '<dynamics damping="9"/></joint>')
    arm = load(robot(*(link(f"l{i}", INERTIA) for i in range(3)), known, joint("j1", "l1", "l2")))
    drives = Drives(*torch.tensor([[0.5, 0.25], [1.5, 2.5], [0.1, 0.1]], dtype=torch.float64))
    write_urdf(arm, real_links(2, 0), tmp_path / "out.urdf", drives)
    model = pin.buildModelFromUrdf(str(tmp_path / "out.urdf"))
    assert model.damping.tolist() == [0.5, 0.25] and model.upperDryFrictionLimit.tolist() == [1.5, 2.5]
    assert (tmp_path / "out.urdf").read_text().count("<dynamics") == 2


def test_friction_below_nothing_is_written_as_none(planar, tmp_path):
    drives = Drives(*torch.tensor([[-0.5, 0.25], [1.5, -2.5], [0, 0]], dtype=torch.float64))
    write_urdf(planar, planar.inertial_parameters, tmp_path / "out.urdf", drives)
    model = pin.buildModelFromUrdf(str(tmp_path / "out.urdf"))
    assert model.damping.tolist() == [0, 0.25] and model.upperDryFrictionLimit.tolist() == [1.5, 0]


@settings(max_examples=25, suppress_health_check=[HealthCheck.function_scoped_fixture, HealthCheck.too_slow])
@given(st.lists(st.sampled_from(["revolute", "prismatic", "fixed"]), min_size=1, max_size=6), st.data())
def test_any_chain_with_fixed_joints_and_links_without_inertia(load, tmp_path, kinds, data):
    kinds = [*kinds, "revolute"]
    bodies = [
        link(f"l{i}", data.draw(st.sampled_from(["", INERTIA, "<!-- > -->"]))) for i in range(len(kinds) + 1)
    ]
    joints = [joint(f"j{i}", f"l{i}", f"l{i + 1}", kind) for i, kind in enumerate(kinds)]
    arm = load(robot(*bodies, *joints))
    parameters = real_links(arm.joints, 0)
    write_urdf(arm, parameters, tmp_path / "out.urdf")
    assert_same_torques(arm, parameters, tmp_path / "out.urdf")


@pytest.mark.parametrize("empty", ['<link name="arm"/>', "<link name='arm' />", '<link name="arm"></link>'])
def test_a_link_without_content_gets_an_inertia(load, tmp_path, empty):
    text = one_joint(inertial="", name="a>b").replace('<link name="arm"></link>', empty)
    arm = load(text)
    write_urdf(arm, real_links(arm.joints, 0), tmp_path / "out.urdf")
    assert_same_torques(arm, real_links(arm.joints, 0), tmp_path / "out.urdf")


def test_comments_extras_and_another_alphabet_stay(load, tmp_path):
    extra = '<!-- <inertial> größer > kleiner --><gazebo reference="arm"><inertial/></gazebo>'
    text = '<?xml version="1.0" encoding="utf-8"?>\n<!-- first -->' + one_joint().replace(
        "</robot>", f"{extra}</robot>"
    )
    arm = load(text)
    write_urdf(arm, real_links(arm.joints, 0), tmp_path / "out.urdf")
    written = (tmp_path / "out.urdf").read_text(encoding="utf-8")
    assert extra in written
    assert written.startswith(text[: text.index("<inertial>", text.index('name="arm"'))])
    assert_same_torques(arm, real_links(arm.joints, 0), tmp_path / "out.urdf")


def test_an_inconsistent_link_is_named_and_nothing_is_written(planar, tmp_path):
    parameters = planar.inertial_parameters.clone()
    parameters[1, 0] = -1.0
    with pytest.raises(RobotError, match="link 'forearm': its mass is -1 kg"):
        write_urdf(planar, parameters, tmp_path / "out.urdf")
    assert not list(tmp_path.iterdir())


def test_a_source_that_is_gone_or_another_is_refused(load, planar, tmp_path):
    arm = load(one_joint())
    arm.urdf.write_text(planar.urdf.read_text(encoding="utf-8"), encoding="utf-8")
    with pytest.raises(RobotError, match="no longer the description of small"):
        write_urdf(arm, real_links(1, 0), tmp_path / "out.urdf")
    arm.urdf.write_text(one_joint(origin='xyz="9 9 9" rpy="0.4 -0.5 0.6"'), encoding="utf-8")
    with pytest.raises(RobotError, match="does not read as small: another translation"):
        write_urdf(arm, real_links(1, 0), tmp_path / "out.urdf")
    arm.urdf.unlink()
    with pytest.raises(RobotError, match="has no URDF to start from"):
        write_urdf(arm, real_links(1, 0), tmp_path / "out.urdf")
    assert not (tmp_path / "out.urdf").exists()


def test_an_encoding_without_plain_tags_is_refused(load, tmp_path):
    arm = load(one_joint())
    text = '<?xml version="1.0" encoding="utf-16"?>' + one_joint()
    arm.urdf.write_text(text, encoding="utf-16")
    with pytest.raises(RobotError, match="save it as UTF-8"):
        write_urdf(arm, real_links(1, 0), tmp_path / "out.urdf")


def test_parameters_of_another_arm_are_refused(planar, tmp_path):
    with pytest.raises(ShapeError, match=r"\(3, 10\), expected \(2, 10\)"):
        write_urdf(planar, torch.ones(3, 10), tmp_path / "out.urdf")


def test_a_folder_that_cannot_be_made_is_told(planar, tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot write"):
        write_urdf(planar, planar.inertial_parameters, tmp_path / "file" / "out.urdf")
