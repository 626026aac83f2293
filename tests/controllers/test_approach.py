"""The way to home is proven, within every limit, and rests at both ends."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, reject, settings
from hypothesis import strategies as st

from sidegan.controllers import ExportSettings, approach
from sidegan.errors import InfeasibleError
from sidegan.motion.dynamics import RigidBody
from sidegan.validity import Constraints, Plane
from tests.chains import random_chain
from tests.validity.critical import holding

EXACTLY = 1e8  # Hz, at which a duration is hardly rounded
DENSE = 20_000  # points


def way(constraints, start, home, **changes):
    """The way, with the usual settings but for these."""
    given = ExportSettings(**changes)
    return approach(constraints, start, home, given)


@pytest.fixture(scope="module")
def desk(arm):
    return Constraints(arm, [Plane(normal=(0, 0, 1), offset=0.1)])


def shares(constraints, course, use):
    """Largest shares of what velocity, acceleration, jerk, and torque beside what holds the arm, may be."""
    arm, body = constraints.arm, constraints.body
    drawn = course.sampled(DENSE / course.duration)
    still = np.zeros_like(drawn.position)
    held = body.torque(drawn.position, still, still)
    moving = body.torque(drawn.position, drawn.velocity, drawn.acceleration) - held
    jerk = np.diff(drawn.acceleration, axis=0) * DENSE / course.duration
    limits = arm.velocity_limit, arm.acceleration_limit, arm.jerk_limit
    states = drawn.velocity, drawn.acceleration, jerk
    found = [(np.abs(x) / (use * most)).max() for x, most in zip(states, limits) if most is not None]
    room = np.minimum(use * arm.torque_limit, arm.torque_limit - held * np.sign(moving))
    return np.stack([*found, (np.abs(moving) / room).max()])


@settings(max_examples=50)
@given(seed=st.integers(0, 10**6), use=st.sampled_from([0.1, 1.0]), tight=st.integers(0, 3))
def test_the_approach_reaches_one_limit_and_exceeds_none(seed, use, tight):
    arm, _ = random_chain(1 + seed % 4, seed)
    start, home = np.random.default_rng(seed).uniform(arm.position_lower, arm.position_upper, (2, arm.joints))
    path = np.linspace(start, home, 2000)
    held = np.abs(RigidBody(arm).torque(path, 0 * path, 0 * path)).max(0)
    tightened = [1e-3 if k == tight else 1.0 for k in range(4)]  # most often the one that decides
    arm = replace(
        arm,
        velocity_limit=tightened[0] * arm.velocity_limit,
        acceleration_limit=tightened[1] * np.full_like(held, 50.0),
        jerk_limit=tightened[2] * np.full_like(held, 1e4),
        torque_limit=held + tightened[3] * np.maximum(300 - held, 50) + 0.002 * held,
    )
    try:
        constraints = Constraints(arm)
        course = way(constraints, start.tolist(), home.tolist(), careful=use, rate=EXACTLY, longest=1e9)
    except InfeasibleError:
        reject()
    assert course.position[0].tolist() == start.tolist() and course.position[-1].tolist() == home.tolist()
    assert not course.velocity[[0, -1]].any() and not course.acceleration[[0, -1]].any()
    found = shares(constraints, course, use)
    assert found.max() < 1 + 1e-6
    if course.duration < 0.5 + 1e-6:  # the shortest, within all limits
        return
    precision = 1e-3 if found.argmax() == 2 else 1e-6  # a jerk is a difference
    assert found.max() > 1 - precision


def test_the_approach_has_a_row_per_tick_and_obeys_the_speed(desk):
    once = way(desk, START, [0.0] * 7)
    assert (once.duration * 100) % 1 == pytest.approx(0) and once.duration > 0.5
    rows = once.sampled(100.0).time
    np.testing.assert_allclose(rows, np.arange(len(rows)) / 100, rtol=0, atol=1e-12)
    slow = way(desk, START, [0.0] * 7, speed=0.05)
    assert slow.duration == pytest.approx(20 * once.duration, abs=0.2 + 0.01)
    assert np.abs(slow.velocity).max() == pytest.approx(0.05 * np.abs(once.velocity).max(), rel=0.01)
    coarse = way(desk, START, [0.0] * 7, rate=8.0)
    assert coarse.duration >= 20 / 8  # of which there are enough to follow it


def test_an_arm_that_is_at_home_rests_there_for_the_shortest_time(desk):
    course = way(desk, HOME, HOME)
    assert course.duration == 0.5 and not course.velocity.any() and not course.acceleration.any()
    np.testing.assert_allclose(course.position - HOME, 0, atol=1e-15)


HOME = [0.1, -0.4, 0.5, 0.7, -0.3, 0.4, 1.0]
START = [0.6, -0.4, 0.5, 0.7, -0.3, 0.4, 1.0]


BULGE = [-1.2, 0.0], [1.9, 0.0]  # ends of a way through the horizontal, where gravity pulls most


@pytest.mark.parametrize("share", [0.34, 0.9])
@pytest.mark.parametrize("use", [0.05, 0.2, 1.0])
def test_high_holding_torque_along_the_way_is_accepted(planar, share, use):
    constraints = Constraints(holding(planar, share))
    course = way(constraints, *BULGE, careful=use)
    assert shares(constraints, course, use)[-1] <= 1


AROUND = [math.pi / 2 - 1, 0.0], [math.pi / 2 + 1, 0.0]
FOLDED = [0.0, 2.0, *[0.0] * 5], [0.0] * 7


def weak(planar):
    return Constraints(replace(planar, torque_limit=0.01 * planar.torque_limit))


def slow(planar):
    return Constraints(replace(planar, velocity_limit=np.array([3.0, 0.001])))


@pytest.mark.parametrize(
    ("words", "make", "ends"),
    [
        ("move the arm closer to home", None, FOLDED),
        ("torque of shoulder", weak, ([0.0, 0.0], [0.9, 0.9])),
        (
            r"shoulder needs 99\.9% of its limit.*robot\.effort",
            lambda arm: Constraints(holding(arm, 0.9992)),
            AROUND,
        ),
        (r"takes 84\d\d s with 20% of the limits of elbow, .*longest=84\d\d", slow, ([0, 0], [0, 0.9])),
    ],
)
def test_an_impossible_approach_is_refused(planar, desk, words, make, ends):
    with pytest.raises(InfeasibleError, match=words):
        way(make(planar) if make else desk, *ends)
