"""Kernels that do several things at once against the plain torch code."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.motion.compiled import tensors
from sidegan.motion.compiled.limits import Limits, Near
from sidegan.motion.dynamics import RigidBody
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
    found = tensors.sums(body.chain, body.base.columns, tuple(states), torque)
    rows = torch.cat([body.base_regressor(*states), torque[..., None]], 2).transpose(0, 1)
    expected = rows.mT @ rows
    torch.testing.assert_close(found, expected, rtol=0, atol=1e-13 * float(expected.abs().max()))


def test_sums_over_threads_are_the_same():
    body, states = body_and_states(5, 0, 4001)
    torque = normal(4001, 5)
    one = tensors.sums(body.chain, body.base.columns, tuple(states), torque)
    torch.set_num_threads(2)
    try:
        two = tensors.sums(body.chain, body.base.columns, tuple(states), torque)
    finally:
        torch.set_num_threads(1)
    torch.testing.assert_close(one, two, rtol=0, atol=1e-13 * float(one.abs().max()))


def plain_cost(body, states, sets, weights, limits):
    """Penalty of each trajectory, and the sum of all whose slopes are wanted."""
    q, dq, _ = states
    own = torch.from_numpy(limits.parameters)[None, None].expand(len(q), 1, -1)
    torque = body._torques_of(*states, own)[:, 0]
    middle, room, speed, most = map(torch.from_numpy, limits[3:7])
    uses = [(q - middle).abs() / room + limits.reserve, dq.abs() / speed + limits.reserve]
    uses.append(torque.abs() / most + limits.torque_reserve)
    cost = limits.weight * sum(((use - 1).clamp_min(0) ** 2).sum((1, 2)) for use in uses)
    energy = (weights * (body._torques_of(*states, sets) ** 2).sum((2, 3))).sum()
    return cost, cost.sum() + energy


@settings(deadline=None, max_examples=20)
@given(st.integers(1, 8), st.integers(0, 30), st.sampled_from([1, 8, 65]), st.floats(0.1, 100.0))
def test_penalised_slopes_are_those_of_the_plain_code(joints, seed, count, weight):
    body, states = body_and_states(joints, seed, 2 * count)
    states = [x.reshape(2, count, joints).requires_grad_(True) for x in states]
    sets, weights = normal(2, 3, 10 * joints), normal(2, 3)
    arm = body.arm
    tight = torch.full((joints,), 0.3, dtype=torch.float64).numpy()  # exceeded by some states
    parameters = arm.inertial_parameters.flatten().contiguous().numpy()
    limits = Limits(weight, 0.2, 0.1, 0.1 * tight, tight, 2 * tight, 10 * tight, parameters)
    value, found = tensors.penalised_slopes(body.chain, states, sets, weights, limits, None)
    cost, total = plain_cost(body, states, sets, weights, limits)
    expected = torch.autograd.grad(total, states)
    torch.testing.assert_close(value, cost.detach(), rtol=1e-12, atol=1e-12)
    scale = max(float(x.abs().max()) for x in expected)
    for one, other in zip(found, expected):
        torch.testing.assert_close(one, other, rtol=0, atol=1e-12 * scale)


def test_an_infinite_torque_limit_costs_nothing(arm):
    body, states = RigidBody(arm), [x.reshape(2, 9, 7) for x in random_states(arm, 18)]
    none = torch.full((7,), torch.inf, dtype=torch.float64).numpy()
    limits = Limits.none(7)._replace(weight=1.0, room=none, speed=none, torque=none)
    sets, weights = normal(2, 1, 70), normal(2, 1)
    value, found = tensors.penalised_slopes(body.chain, states, sets, weights, limits, None)
    assert not value.any()
    for one, other in zip(found, body.energy_slopes(*states, sets, weights)):
        torch.testing.assert_close(one, other, rtol=0, atol=0)


def test_distances_add_what_closeness_says(arm):
    body, states = RigidBody(arm), [x.reshape(2, 40, 7) for x in random_states(arm, 80)]
    capsules, count = arm.capsules, len(arm.capsules.link)
    pairs = torch.tensor([(i, k) for i in range(count) for k in range(i + 2, count)])
    guarded = torch.tensor([(0, k) for k in range(count)])
    planes = torch.tensor([[0.0, 0.0, 1.0, 0.1]], dtype=torch.float64)
    shapes = [capsules.link, torch.stack([capsules.a, capsules.b]), capsules.radius, pairs, guarded, planes]
    sets, weights = normal(2, 1, 70), normal(2, 1)
    given = body.chain, states, sets, weights, Limits.none(7)
    with_them, without = (tensors.penalised_slopes(*given, near) for near in (Near(3.0, 0.2, shapes), None))
    value, slope = tensors.closeness(body.chain, shapes, states[0], 0.2)
    assert (value > 0).all()
    torch.testing.assert_close(with_them[0], 3 * value)
    torch.testing.assert_close(with_them[1][0] - without[1][0], 3 * slope, rtol=1e-9, atol=1e-9)


def test_an_error_in_a_thread_is_raised():
    done = []

    def work(k):
        done.append(k)
        if k == 1:
            raise ArithmeticError("of thread 1")

    with pytest.raises(ArithmeticError, match="of thread 1"):
        tensors._each(work, 3)
    assert sorted(done) == [0, 1, 2]
