"""Compiled kernels against the plain torch code and finite differences."""

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sidegan.motion import plain, threads
from sidegan.motion.compiled.chain import Chain
from sidegan.motion.compiled.limits import Limits, Near
from sidegan.motion.dynamics import RigidBody, gram, gram_of
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints
from tests.chains import random_chain, random_states
from tests.motion.conftest import REGIONS, body_and_states, close, normal
from tests.threads import several_threads

pytest.importorskip("numba")

CHAINS = st.tuples(st.integers(1, 9), st.integers(0, 30))
COUNTS = st.sampled_from([1, 8, 63, 65, 130])  # around the number of lanes, and more than a span
SIZES = st.tuples(st.integers(1, 3), COUNTS)


@settings(deadline=None, max_examples=15)
@given(CHAINS, SIZES)
def test_grams_are_those_of_the_plain_code(chain, size):
    body, states = body_and_states(chain, *size)
    close(gram_of(body, *states), plain.gram(body, body.base.columns, states), 1e-13)


@settings(deadline=None, max_examples=12)
@given(CHAINS, COUNTS)
def test_sums_are_those_of_the_regressor(chain, count):
    body, states = body_and_states(chain, count)
    torque = normal(count, body.joints)
    close(body.sums(*states, torque), plain.sums(body, states, torque), 1e-13)


@settings(deadline=None, max_examples=15)
@given(CHAINS, SIZES, st.integers(1, 4))
def test_torques_and_their_slopes_are_those_of_the_plain_code(chain, size, sets):
    body, states = body_and_states(chain, *size)
    v, cotangent = normal(size[0], sets, 10 * body.joints), normal(size[0], sets, size[1], body.joints)
    x = [part.requires_grad_(True) for part in states]
    torques, expected = body.torques_of(*x, v), plain.torques(body, x, v)
    close(torques, expected, 1e-13)
    ours, reference = (torch.autograd.grad(torque, x, cotangent) for torque in (torques, expected))
    close(ours, reference, 1e-12)


@settings(deadline=None, max_examples=15)
@given(CHAINS, st.sampled_from([1, 8, 65]), st.floats(0.1, 100.0) | st.none())
def test_penalised_slopes_are_those_of_the_plain_code(chain, count, weight):
    body, states = body_and_states(chain, 2, count)
    sets, weights, limits = normal(2, 3, 10 * body.joints), normal(2, 3), Limits.none(body.joints)
    if weight is not None:
        tight = torch.full((body.joints,), 0.3, dtype=torch.float64).numpy()  # exceeded by some states
        parameters = body.arm.inertial_parameters.flatten().contiguous().numpy()
        limits = Limits(weight, 0.2, 0.1, 0.1 * tight, tight, 2 * tight, 10 * tight, parameters)
    value, slopes = body.penalised_slopes(states, sets, weights, limits, None)
    cost, expected = plain.penalised_slopes(body, states, sets, weights, limits, None)
    torch.testing.assert_close(value, cost, rtol=1e-12, atol=1e-12)
    close(slopes, expected, 1e-12)


def test_an_infinite_torque_limit_costs_nothing(arm):
    body, states = RigidBody(arm), [x.reshape(2, 9, 7) for x in random_states(arm, 18)]
    none = torch.full((7,), torch.inf, dtype=torch.float64).numpy()
    limits = Limits.none(7)._replace(weight=1.0, room=none, speed=none, torque=none)
    sets, weights = normal(2, 1, 70), normal(2, 1)
    value, slopes = body.penalised_slopes(states, sets, weights, limits, None)
    assert not value.any()
    for one, other in zip(slopes, body.penalised_slopes(states, sets, weights)[1]):
        torch.testing.assert_close(one, other, rtol=1e-12, atol=1e-9)


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


def test_slopes_agree_with_finite_differences(engine):
    body, states = body_and_states((4, 1), 2, 2)  # joints that turn and joints that slide
    x = tuple(part.requires_grad_(True) for part in states)
    v, own = normal(2, 2, 10 * body.joints), body.arm.inertial_parameters.clone().requires_grad_(True)
    assert torch.autograd.gradcheck(lambda *s: body.torques_of(*s, v), x)
    assert torch.autograd.gradcheck(body.torque, (*x, own))
    assert torch.autograd.gradcheck(body.regressor, x, fast_mode=True)


def test_gradients_of_any_function_of_the_gram_agree_with_finite_differences(engine):
    arm, _ = random_chain(3, 3)
    body, trajectory = RigidBody(arm), Trajectory(3, 1, 8.0)
    c = (0.3 * normal(2, *trajectory.shape)).requires_grad_(True)

    def several(x):
        grams = gram(body, trajectory, x, 12)
        return grams, grams.diagonal(dim1=1, dim2=2).square(), (grams * grams).sum()

    assert torch.autograd.gradcheck(several, c, rtol=1e-3, atol=1e-4)


def test_a_derivative_can_be_derived_again(planar, engine):
    body = RigidBody(planar)
    x = tuple(part.requires_grad_(True) for part in random_states(planar, 2))
    assert torch.autograd.gradgradcheck(body.torque, x)
    trajectory = Trajectory(2, 1, 8.0)
    c = (0.3 * normal(1, *trajectory.shape)).requires_grad_(True)
    assert torch.autograd.gradgradcheck(lambda x: gram(body, trajectory, x, 12), c, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("rows", range(1, 10))
def test_a_product_in_tiles_of_four_reads_no_row_that_is_not_there(rows):
    """As plain Python, which refuses what compiled code would read behind the last row."""
    from sidegan.motion.compiled.regressor import tile

    y, product, ends = normal(rows, 7).numpy(), np.zeros((rows, rows)), range(0, rows, 4)
    for i in ends:
        for j in ends:
            tile.py_func(y, (i, rows), (j, rows), 1, 6, product)
    np.testing.assert_allclose(product, y[:, 1:6] @ y[:, 1:6].T, atol=1e-14)


def test_results_do_not_depend_on_threads_or_batches(arm):
    body, trajectory = RigidBody(arm), Trajectory(7)
    c, states = 0.2 * normal(60, *trajectory.shape), random_states(arm, 4001)
    torque = normal(4001, 7)
    one, sums = gram(body, trajectory, c), body.sums(*states, torque)
    with several_threads():
        torch.testing.assert_close(gram(body, trajectory, c), one, rtol=1e-13, atol=1e-12)
        close(body.sums(*states, torque), sums, 1e-13)
    torch.testing.assert_close(gram(body, trajectory, c[7:8]), one[7:8], rtol=1e-13, atol=1e-12)


def test_an_error_in_a_thread_is_raised():
    done = []

    def work(k):
        done.append(k)
        if k == 1:
            raise ArithmeticError("of thread 1")

    with pytest.raises(ArithmeticError, match="of thread 1"):
        threads.each(work, 3)
    assert sorted(done) == [0, 1, 2]


@pytest.mark.parametrize("shape", [(0, 5, 7), (2, 0, 7)])
def test_no_state_is_no_work(arm, shape):
    q = torch.zeros(shape, dtype=torch.float64, requires_grad=True)
    RigidBody(arm).torque(q, q, q).sum().backward()
    assert q.grad is not None and q.grad.shape == shape


def test_chain_places_joints_as_the_arm_does(arm):
    """A joint turns about its axis, or slides along it, in the frame that it has at zero."""
    for other in (arm, random_chain(6, 4)[0]):
        q, chain = random_states(other, 1)[0][0], Chain.of(other)
        for i, angle in enumerate(q.tolist()):
            turn = 0.0 if other.prismatic[i] else angle
            own = Rotation.from_rotvec(turn * other.axis[i].numpy()).as_matrix()
            mixed = chain.fixed[i] + chain.sine[i] * np.sin(angle) + chain.cosine[i] * np.cos(angle)
            expected = other.rotation[i].numpy() @ own
            np.testing.assert_allclose(mixed, expected.flatten(), atol=1e-14)
            slide = other.rotation[i] @ other.axis[i] * (angle - turn)
            place = chain.origin[i] + chain.slide[i] * angle
            np.testing.assert_allclose(place, other.translation[i] + slide, atol=1e-14)
