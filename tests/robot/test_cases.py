"""Descriptions with missing or impossible masses, shapes and limits."""

import logging
from dataclasses import replace

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from sidegan.errors import ConfigError, RobotError
from sidegan.identification.goals import usual_torque
from sidegan.motion.dynamics import RigidBody
from sidegan.plant import IDEAL, mujoco_model
from sidegan.robot import (
    describe_doubtful_links,
    doubtful_links,
    inconsistent_links,
    load_robot,
    possible_links,
)
from sidegan.robot.visuals import visual_parts
from sidegan.robot.write_mjcf import mujoco_logged
from sidegan.validity.pairs import describe_displaced_shapes, sampled
from sidegan.validity.remedies import describe_placeholder_limits
from tests.identification.recordings import identified
from tests.identification.test_cases import recordings
from tests.pipeline.test_workspace import workspace
from tests.robot.urdf import collision, joint, link, mesh, robot

AXES = ("0 0 1", "0 1 0", "0 1 0", "0 0 1")
LIMIT = '<limit lower="-2.8" upper="2.8" velocity="2" effort="50"/>'


def rod(place='xyz="0 0 0.15"'):
    return collision('<cylinder radius="0.04" length="0.24"/>', place)


def inertial(mass="2", moments=(0.02, 0.02, 0.004), place="0.01 0.005 0.15"):
    moments = " ".join(f'{name}="{x}"' for name, x in zip(("ixx", "iyy", "izz"), moments))
    moments += ' ixy="0" ixz="0" iyz="0"'
    return f'<inertial><origin xyz="{place}"/><mass value="{mass}"/><inertia {moments}/></inertial>'


def arm_of(content=None, limit=LIMIT, base=None):
    """URDF of four rods in a row; `content` replaces what links are made of, by number."""
    parts = [link("base", rod('xyz="0 0 0.02"') if base is None else base)]
    for k, axis in enumerate(AXES):
        place, before = f'xyz="0 0 {0.3 if k else 0.1}"', f"link{k - 1}" if k else "base"
        parts.append(joint(f"joint{k}", before, f"link{k}", "revolute", place, axis, limit))
        parts.append(link(f"link{k}", (content or {}).get(k, inertial() + rod())))
    return robot(*parts, name="rods")


BARE = dict.fromkeys(range(4), "")
KINDS = {  # what link 1 says of its mass, and what is said of that
    "the largest exceeds": inertial(moments=(0.02, 0.02, 0.042)),
    "too far out": inertial(moments=(-0.02, 0.02, 0.004)),
    "its mass is 0 kg": "",
    "its mass is 0 kg, expected more": inertial(mass=0),
    "its mass is 0 kg, ": inertial(mass=-3),
    "mass is 0 kg": inertial(mass="nan"),
    "1e-06 kg at": inertial(mass=1e-6, moments=(1e-9, 1e-9, 1e-9)),
    "2 kg at 150 m from its joint": inertial(place="10 5 150"),
    "": inertial(moments=(1e-9, 1e-9, 1e-9)),  # can be, and is too thin to start from
}


@pytest.mark.parametrize(("said", "inside"), KINDS.items(), ids=[*KINDS])
def test_an_impossible_link_is_reported_and_replaced_by_the_nearest_possible_one(load, said, inside):
    arm, whole = load(arm_of({1: inside + rod()})), load(arm_of()).inertial_parameters
    assert said in describe_doubtful_links(arm) and [*doubtful_links(arm)] == (["link1"] if said else [])
    start = possible_links(arm)
    assert inconsistent_links(arm, start) == [] and np.array_equal(start[[0, 2, 3]], whole[[0, 2, 3]])
    if "kg" not in said:  # mass and place are kept, and only the inertia is another
        np.testing.assert_allclose(start[1, :4], whole[1, :4])


def test_an_arm_is_identified_despite_missing_masses(load):
    truth, arm = load(arm_of()), load(arm_of(BARE))
    training, validation = recordings(arm=arm, truth=truth)
    found = identified(arm, [training], [validation])
    assert found.use == "consistent" and found.tested["consistent"].nmse_mean < 2e-3
    assert inconsistent_links(arm, found.links) == []


def test_identification_needs_neither_limits_nor_meshes(load, caplog, tmp_path):
    text = arm_of({1: inertial() + mesh("lost.stl")}, '<limit effort="50"/>')
    with pytest.raises(RobotError, match="state the arm's limits"):
        load(text)
    caplog.clear()
    arm = load_robot(tmp_path / "robot.urdf", planning=False)
    assert not caplog.records and arm.velocity_limit.tolist() == [1.0] * 4
    assert "missing from the description are assumed to be 'robot.limits.position={joint0: " in arm.notes[0]


@pytest.mark.parametrize(
    ("content", "base", "why"),
    [
        ("", "", "the description has no <inertial>"),
        ("", inertial(), "only links that do not move have a mass: base"),
        (inertial(mass=0, moments=(0, 0, 0)), "", "every <inertial> has a mass of 0 kg"),
        (inertial(mass="nan"), "", "link 'link0': <mass value='nan'>"),
    ],
)
def test_usual_torques_without_masses_are_refused_with_the_reason(load, content, base, why):
    arm = load(arm_of(dict.fromkeys(range(4), content), base=base))
    with pytest.raises(ConfigError, match=rf"^no moving link of rods has a mass \(.*{why}.*\), so its usual"):
        usual_torque(RigidBody(arm))


@pytest.mark.parametrize("place", ["1 0 0.15", "0 -0.8 0.15", "0 0 1.2"])
def test_displaced_shapes_are_reported(load, place):
    said = describe_displaced_shapes(load(arm_of({1: inertial() + rod(f'xyz="{place}"')})))
    assert "never come close to each other: link0 – link1 (" in said
    arms = [load(arm_of()), load(arm_of(BARE, base="")), load_robot("kuka_lwr4"), load_robot("planar2")]
    assert [describe_displaced_shapes(arm) + describe_placeholder_limits(arm) for arm in arms] == [""] * 4


@pytest.mark.parametrize("shaped", [0, 1, 2, 3, 5])
def test_joint_origins_of_links_without_shapes_stay_above_the_floor(load, shaped):
    """Of an arm of which the base and the first links have shapes; heights are Pinocchio's."""
    place = replace(workspace(choice="desk"), clearance=None)
    bare = dict.fromkeys(range(max(shaped - 1, 0), 4), inertial())
    arm = load(arm_of(bare, base=None if shaped else ""))
    assert "floor at z = 0 m" in place.notes(arm)
    assert ("joint_origins" in place.stamped(arm)) == (0 < shaped < 5)
    said = (constraints := place.around(arm)).described()
    assert ("0 of 0 pairs" in said and "4 of 4 joint origins against 1 region" in said) == (shaped < 2)
    assert ("clear" in said) == (shaped > 1) == np.isfinite(constraints.nearest(np.zeros((1, 4)))[0]).all()
    model = pin.buildModelFromUrdf(str(arm.urdf))
    q = sampled(arm, 200)
    free = constraints.at_rest(q)["keep_out"].min(1) >= 0
    lowest = np.array([heights(model, x).min() for x in q])
    assert (lowest[free] >= 0).all() and (shaped > 1 or (free == (lowest >= 0)).all())
    assert free.any() and not free.all()


def heights(model, q):
    """Heights [m] of the origins of all joints but the first, which does not move, (J - 1,)."""
    data = model.createData()
    pin.forwardKinematics(model, data, q)
    return np.array([place.translation[2] for place in data.oMi[2:]])


@pytest.mark.parametrize(
    ("span", "velocity", "effort", "said"),
    [
        (2, 1000, 50, "velocity of joint0, joint1, joint2, joint3 (up to 1000)"),
        (2, 2, 1000, "'robot.limits.effort={joint0: "),
        (10, 2, 50, "'robot.limits.position={joint0: …, "),
        (170, 2, 50, "position of joint0, joint1, joint2, joint3 (up to 170)"),
    ],
)
def test_placeholder_limits_are_reported_with_the_setting_to_change(load, span, velocity, effort, said):
    limit = f'<limit lower="-{span}" upper="{span}" velocity="{velocity}" effort="{effort}"/>'
    assert said in describe_placeholder_limits(load(arm_of(limit=limit)))


def test_mujoco_warnings_are_logged_and_lost_visuals_give_one_message(load, tmp_path, monkeypatch, caplog):
    monkeypatch.chdir(tmp_path)
    model = mujoco_model(load_robot("planar2"), IDEAL)
    data = mujoco.MjData(model)
    data.qfrc_applied[:] = 1e12
    with caplog.at_level(logging.DEBUG):
        with mujoco_logged("planar2"):
            mujoco.mj_step(model, data, 50)
        assert "planar2: " in caplog.text and not (tmp_path / "MUJOCO_LOG.TXT").exists()
        visual_parts(load(arm_of({k: inertial() + mesh(f"{k}.stl") for k in range(4)})))
    shown = [record for record in caplog.records if "not shown" in record.message]
    assert len(shown) == 1 and "link0, link1, link2, link3" in shown[0].message
