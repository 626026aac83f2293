"""Kernels that do several things at once against the plain torch code."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.motion import plain, threads
from sidegan.motion.compiled.limits import Limits, Near
from sidegan.motion.dynamics import RigidBody
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from tests.chains import random_chain, random_states

pytest.importorskip("numba")


def body_and_states(joints, seed, count):
    arm, _ = random_chain(joints, seed)
    return RigidBody(arm), random_states(arm, count, seed)


def normal(*shape):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)


@settings(deadline=None, max_examples=20)
@given(st.integers(1, 8), st.integers(0, 30), st.sampled_from([1, 8, 65, 130, 300]))
def test_sums_are_those_of_the_regressor(joints, seed, count):
    body, states = body_and_states(joints, seed, count)
    torque = normal(count, joints)
    expected = plain.sums(body, states, torque)
    torch.testing.assert_close(
        body.sums(*states, torque), expected, rtol=0, atol=1e-13 * float(expected.abs().max())
    )


def test_sums_over_threads_are_the_same():
    body, states = body_and_states(5, 0, 4001)
    torque = normal(4001, 5)
    one = body.sums(*states, torque)
    torch.set_num_threads(2)
    try:
        two = body.sums(*states, torque)
    finally:
        torch.set_num_threads(1)
    torch.testing.assert_close(one, two, rtol=0, atol=1e-13 * float(one.abs().max()))


@settings(deadline=None, max_examples=20)
@given(st.integers(1, 8), st.integers(0, 30), st.sampled_from([1, 8, 65]), st.floats(0.1, 100.0))
def test_penalised_slopes_are_those_of_the_plain_code(joints, seed, count, weight):
    body, states = body_and_states(joints, seed, 2 * count)
    states = [x.reshape(2, count, joints) for x in states]
    sets, weights = normal(2, 3, 10 * joints), normal(2, 3)
    arm = body.arm
    tight = torch.full((joints,), 0.3, dtype=torch.float64).numpy()  # exceeded by some states
    parameters = arm.inertial_parameters.flatten().contiguous().numpy()
    limits = Limits(weight, 0.2, 0.1, 0.1 * tight, tight, 2 * tight, 10 * tight, parameters)
    value, slopes = body.penalised_slopes(states, sets, weights, limits, None)
    cost, expected = plain.penalised_slopes(body, states, sets, weights, limits, None)
    torch.testing.assert_close(value, cost, rtol=1e-12, atol=1e-12)
    scale = max(float(x.abs().max()) for x in expected)
    for one, other in zip(slopes, expected):
        torch.testing.assert_close(one, other, rtol=0, atol=1e-12 * scale)


def test_an_infinite_torque_limit_costs_nothing(arm):
    body, states = RigidBody(arm), [x.reshape(2, 9, 7) for x in random_states(arm, 18)]
    none = torch.full((7,), torch.inf, dtype=torch.float64).numpy()
    limits = Limits.none(7)._replace(weight=1.0, room=none, speed=none, torque=none)
    sets, weights = normal(2, 1, 70), normal(2, 1)
    value, slopes = body.penalised_slopes(states, sets, weights, limits, None)
    assert not value.any()
    for one, other in zip(slopes, body.penalised_slopes(states, sets, weights)[1]):
        torch.testing.assert_close(one, other, rtol=1e-12, atol=1e-9)


REGIONS = {
    "plane": Plane((0.0, 0.0, 1.0), 0.1),
    "box": Box((0.3, -0.2, 0.3), (0.6, 0.3, 0.6)),
    "ball": Sphere((0.4, 0.2, 0.5), 0.2),
    "body": Convex.between((-0.5, -0.4, 0.2), (-0.3, -0.2, 0.9), 0.1),
}


@pytest.mark.parametrize("region", REGIONS)
def test_distances_cost_what_the_plain_code_says(arm, region):
    body, states = RigidBody(arm), [x.reshape(2, 40, 7) for x in random_states(arm, 80)]
    constraints = Constraints(arm, [REGIONS[region]])
    near = Near(3.0, 0.2, constraints.shapes, constraints.distances)
    sets, weights, none = normal(2, 1, 70), 1e-6 * normal(2, 1), Limits.none(7)
    value, slopes = body.penalised_slopes(states, sets, weights, none, near)
    cost, expected = plain.penalised_slopes(body, states, sets, weights, none, near)
    assert (value > 0).all()
    torch.testing.assert_close(value, cost)
    for one, other in zip(slopes, expected):
        torch.testing.assert_close(one, other, rtol=1e-9, atol=1e-9)


def test_an_error_in_a_thread_is_raised():
    done = []

    def work(k):
        done.append(k)
        if k == 1:
            raise ArithmeticError("of thread 1")

    with pytest.raises(ArithmeticError, match="of thread 1"):
        threads.each(work, 3)
    assert sorted(done) == [0, 1, 2]
