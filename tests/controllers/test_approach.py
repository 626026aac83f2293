"""The way to home is proven, within every limit, and rests at both ends."""

import math
from dataclasses import replace

import pytest
import torch

from sidegan.controllers.approach import approach
from sidegan.errors import InfeasibleError
from sidegan.motion.dynamics import RigidBody
from sidegan.validity import Constraints, Plane

START = [0.6, -0.4, 0.5, 0.7, -0.3, 0.4, 1.0]


@pytest.fixture(scope="module")
def desk(arm):
    return Constraints(arm, [Plane(normal=(0, 0, 1), offset=0.1)])


def assert_within_torques(constraints, course, use):
    """No torque exceeds its limit, and what moves the arm not the share of it."""
    arm, body, still = constraints.arm, constraints.body, torch.zeros_like(course.position)
    torque = body.torque(course.position, course.velocity, course.acceleration)
    held = body.torque(course.position, still, still)
    assert (torque.abs() <= arm.torque_limit).all()
    assert ((torque - held).abs() <= use * arm.torque_limit).all()


@pytest.mark.parametrize("use", [0.1, 0.5, 1.0])
def test_no_limit_is_used_more_than_is_allowed(arm, use):
    limit = torch.full_like(arm.velocity_limit, 3.0)
    slow = Constraints(replace(arm, acceleration_limit=limit, jerk_limit=10 * limit))
    course = approach(slow, START, [0.0] * 7, use)
    step = float(course.time[1])
    for name, most in (("velocity", arm.velocity_limit), ("acceleration", limit)):
        assert (getattr(course, name).abs() <= use * most * (1 + 1e-9)).all()
    assert (course.acceleration.diff(dim=0).abs() / step <= use * 10 * limit * (1 + 1e-6)).all()
    assert_within_torques(slow, course, use)
    for x in (course.velocity, course.acceleration):
        assert x[[0, -1]].abs().max() < 1e-12
    assert course.position[0].tolist() == START and course.position[-1].abs().max() < 1e-12


BULGE = [-1.2, 0.0], [1.9, 0.0]  # ends of a way through the horizontal, where gravity pulls most


def holding(planar, share):
    """The planar arm in free space, held by a share of its limits where gravity pulls most."""
    out = torch.tensor([[torch.pi / 2, 0.0]], dtype=torch.float64)
    limit = RigidBody(planar).torque(out, 0 * out, 0 * out)[0].abs() / share
    return Constraints(replace(planar, torque_limit=limit))


@pytest.mark.parametrize("share", [0.34, 0.9])
@pytest.mark.parametrize("use", [0.05, 0.2, 1.0])
def test_what_holds_the_arm_between_the_ends_is_no_reason_to_refuse(planar, share, use):
    constraints = holding(planar, share)
    course = approach(constraints, *BULGE, use)
    assert_within_torques(constraints, course, use)


AROUND = [math.pi / 2 - 1, 0.0], [math.pi / 2 + 1, 0.0]
FOLDED = [0.0, 2.0, *[0.0] * 5], [0.0] * 7


def weak(planar):
    return Constraints(replace(planar, torque_limit=0.01 * planar.torque_limit))


@pytest.mark.parametrize(
    ("words", "make", "ends"),
    [
        ("bring the arm closer to home", None, FOLDED),
        ("torque of shoulder", weak, ([0.0, 0.0], [0.9, 0.9])),
        (r"shoulder needs 99\.9% of its limit.*robot\.effort", lambda arm: holding(arm, 0.9992), AROUND),
    ],
)
def test_what_cannot_be_driven_is_refused(planar, desk, words, make, ends):
    with pytest.raises(InfeasibleError, match=words):
        approach(make(planar) if make else desk, *ends, 0.2)
