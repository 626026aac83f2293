"""What a link can be: against mass distributions, Pinocchio's pseudo-inertia, and each way to be wrong."""

import re

import numpy as np
import pinocchio as pin
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sidegan.errors import RobotError, ShapeError
from sidegan.robot import built_in_robots, inconsistent_links, load_robot, pseudo_inertia, require_consistent
from tests.chains import random_chain

from .urdf import one_joint


def links(parameters):
    """Links of parameters (J, 10) that cannot exist, of some arm."""
    return inconsistent_links(random_chain(len(parameters), 0)[0], parameters)


ROD = (2.0, 0.0, 0.0, 0.4, 0.1, 0.0, 0.1, 0.0, 0.0, 0.002)


def of(*parameters):
    return torch.tensor([parameters], dtype=torch.float64)


def points(random, count):
    """Parameters of point masses, which exist by construction."""
    mass, place = random.uniform(0.1, 2.0, count), random.normal(size=(count, 3))
    total = sum(pin.Inertia(m, p, np.zeros((3, 3))).toDynamicParameters() for m, p in zip(mass, place))
    return torch.from_numpy(total)[None]


@pytest.mark.parametrize("name", built_in_robots())
def test_built_in_arms_are_consistent(name):
    assert inconsistent_links(load_robot(name)) == []


@given(st.integers(0, 2**31), st.integers(4, 9))
def test_masses_at_points_are_consistent(seed, count):
    assert links(points(np.random.default_rng(seed), count)) == []


def test_a_flat_plate_is_consistent():
    assert links(of(1.0, 0.0, 0.0, 0.0, 0.01, 0.0, 0.02, 0.0, 0.0, 0.03)) == []


def test_pseudo_inertia_is_pinocchios():
    arm, _ = random_chain(4, 0)
    for mine, row in zip(pseudo_inertia(arm.inertial_parameters), arm.inertial_parameters):
        theirs = pin.Inertia.FromDynamicParameters(row.numpy()).toPseudoInertia().toMatrix()
        np.testing.assert_allclose(mine, theirs, atol=1e-12)


@given(st.integers(0, 2**31))
def test_consistent_means_a_positive_definite_pseudo_inertia(seed):
    random = np.random.default_rng(seed)
    link = points(random, 5) + torch.from_numpy(random.normal(size=(1, 10)) * random.choice([0.1, 1.0, 5.0]))
    definite = bool((torch.linalg.eigvalsh(pseudo_inertia(link)) > 0).all())
    assert (links(link) == []) == definite


@pytest.mark.parametrize(
    ("parameters", "reason"),
    [
        (of(0.0, *ROD[1:]), "its mass is 0 kg"),
        (of(-1.0, *ROD[1:]), "its mass is -1 kg"),
        (of(2.0, 0.0, 0.0, 1.0, *ROD[4:]), r"centre of mass \(0, 0, 0.5\) m is too far out for its inertia"),
        (of(*ROD[:4], -0.1, *ROD[5:]), "about the centre of mass, expected more than 0"),
        (of(1.0, 0.0, 0.0, 0.0, 0.1, 0.0, 0.1, 0.0, 0.0, 0.3), "the largest exceeds the sum of the others"),
        (of(float("nan"), *ROD[1:]), "not finite"),
    ],
)
def test_every_way_to_be_wrong_is_named(parameters, reason):
    ((link, why),) = links(torch.cat([of(*ROD), parameters]))
    assert link == "joint2"
    assert re.search(reason, why)


def test_links_of_an_arm_have_their_urdfs_names(load):
    nothing = (
        '<inertial><mass value="0"/><inertia ixx="0" ixy="0" ixz="0" iyy="0" iyz="0" izz="0"/></inertial>'
    )
    arm = load(one_joint(nothing))
    assert [link for link, _ in inconsistent_links(arm)] == ["arm"]
    with pytest.raises(RobotError, match="small is not physically consistent: link 'arm': its mass is 0 kg"):
        require_consistent(arm)


def test_an_arm_without_link_names_has_its_joints_names():
    arm, _ = random_chain(3, 0)
    assert arm.link_names == arm.joint_names


@pytest.mark.parametrize("shape", [(10,), (2, 9), (1, 2, 10), (1, 10)])
def test_parameters_of_another_shape_are_refused(shape):
    with pytest.raises(ShapeError, match="expected \\(2, 10\\)"):
        inconsistent_links(random_chain(2, 0)[0], torch.ones(shape, dtype=torch.float64))
