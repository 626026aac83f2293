"""What a description says and leaves out, the digest of all its numbers, and which links can be."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidegan.robot import built_in_robots, inconsistent_links, load_robot, pseudo_inertia
from sidegan.robot.arm import digest_of
from tests.chains import random_chain
from tests.recording.conftest import real

from .urdf import INERTIA, joint, link, more, one_joint, two_joints


def test_links_behind_fixed_joints_are_lumped_into_their_parent(load):
    bare = load(one_joint())
    loaded = load(more(one_joint(), joint("grip", "arm", "tool", "fixed", 'xyz="0 0 0.5"'), link("tool")))
    assert loaded.joints == 1
    assert loaded.inertial_parameters[0, 0].item() == pytest.approx(3.0)
    assert (bare.tip.tolist(), loaded.tip.tolist()) == ([0, 0, 0], [0, 0, 0.5])


def test_optional_parts_of_a_description(load):
    assert np.abs(load(one_joint(inertial="")).inertial_parameters).max() == 0.0
    assert load(one_joint(inertial=INERTIA.replace("1.5", "0"))).inertial_parameters[0, 0] == 0.0
    for effort in ("", 'effort="0"'):
        limit = f'<limit lower="-1" upper="1" velocity="1" {effort}/>'
        assert load(two_joints(limit=limit)).torque_limit.tolist() == [40, np.inf]
    slide = load(one_joint(kind="prismatic", limit='<limit upper="0.3" velocity="1"/>'))
    assert (slide.position_lower.item(), slide.position_upper.item()) == (0.0, 0.3)
    extra = '<visual><geometry><mesh filename="gone.dae"/></geometry></visual>'
    assert load(more(one_joint(collision=extra), "<gazebo/><transmission/>")).joints == 1


CHANGES = [
    ('value="1.5"', 'value="1.500001"'),
    ('izz="0.01"', 'izz="0.0100000001"'),
    ('upper="2"', 'upper="2.1"'),
    ('velocity="2.5"', 'velocity="2.4"'),
    ('effort="40"', ""),
    ('xyz="0.1 0.2 0.3"', 'xyz="0.1 0.2 0.31"'),
    ('axis xyz="0 0 1"', 'axis xyz="0 1 0"'),
    ('type="revolute"', 'type="prismatic"'),
    ("</inertial>", '</inertial><collision><geometry><sphere radius="1"/></geometry></collision>'),
]


class TestDigest:
    def test_ignores_names_and_paths(self, load):
        arm = load(one_joint(), name="one.urdf")
        other = load(one_joint(name="another").replace("turn", "rotate"), name="other.urdf")
        assert arm.name != other.name
        assert arm.digest == other.digest == load(one_joint(), name="one.urdf").digest

    @pytest.mark.parametrize(("old", "new"), CHANGES)
    def test_depends_on_every_number(self, load, old, new):
        text = one_joint()
        assert old in text
        assert load(text).digest != load(text.replace(old, new)).digest

    def test_of_the_built_in_arms_is_unchanged(self):
        assert {name: load_robot(name).digest for name in built_in_robots()} == {
            "kuka_lwr4": "ac8f005317e3349fe3371916674b3207a84acd6ad35499d52e8b4c6e62b50325",
            "planar2": "782716eca7baafb26ac6dc57887f35d6df963518e909723f28e8cd421602c45f",
        }

    @pytest.mark.parametrize("name", built_in_robots())
    def test_survives_rounding_errors(self, name):
        arm = load_robot(name)
        exact = {name: x for name, x in vars(arm).items() if isinstance(x, np.ndarray)}
        shaken = {k: x if x.dtype == np.bool_ else x * (1 + 2e-16) + 1e-17 for k, x in exact.items()}
        capsules = replace(arm.capsules, a=arm.capsules.a - 1e-17)
        assert digest_of(exact, arm.capsules) == arm.digest
        assert digest_of(shaken, capsules) == arm.digest


def test_inertias_of_the_lwr_are_those_of_the_table(arm):
    figures = np.loadtxt(real("kuka_lwr4/inertial_parameters.csv"), delimiter=",", skiprows=1)[:, 1:]
    np.testing.assert_allclose(arm.inertial_parameters, figures, rtol=0, atol=1e-12)


def test_a_flat_plate_is_physically_consistent():
    plate = np.array([[1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.02, 0.0, 0.0, 0.03]], dtype=float)
    assert inconsistent_links(random_chain(1, 0)[0], plate) == []


def test_pseudo_inertia_is_pinocchios():
    arm, _ = random_chain(4, 0)
    for mine, row in zip(pseudo_inertia(arm.inertial_parameters), arm.inertial_parameters):
        theirs = pin.Inertia.FromDynamicParameters(row).toPseudoInertia().toMatrix()
        np.testing.assert_allclose(mine, theirs, atol=1e-12)


@given(st.integers(0, 2**31), st.integers(4, 9), st.sampled_from([0.0, 0.1, 1.0, 5.0]))
def test_consistent_means_a_positive_definite_pseudo_inertia(seed, count, beside):
    """Of masses at points, which exist by construction, and of what is beside these."""
    random = np.random.default_rng(seed)
    mass, place = random.uniform(0.1, 2.0, count), random.normal(size=(count, 3))
    points = sum(pin.Inertia(m, p, np.zeros((3, 3))).toDynamicParameters() for m, p in zip(mass, place))
    link = (points + beside * random.normal(size=10))[None]
    definite = bool((np.linalg.eigvalsh(pseudo_inertia(link)) > 0).all())
    assert (inconsistent_links(random_chain(1, 0)[0], link) == []) == definite
    if not beside:
        assert definite
