"""Compiled kernels against Pinocchio, definitions and finite differences."""

import numpy as np
import pinocchio as pin
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sidegan.kernels.limits import Limits, Near
from sidegan.motion import threads
from sidegan.motion.arrays import chain_of
from sidegan.motion.dynamics import RigidBody, gram, gram_of
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints
from tests.chains import random_chain, random_states
from tests.motion.conftest import REGIONS, body_and_states, close, normal
from tests.threads import several_threads

CHAINS = st.tuples(st.integers(1, 9), st.integers(0, 30))
COUNTS = st.sampled_from([1, 8, 63, 65, 130])  # around the number of lanes, and more than a span
SIZES = st.tuples(st.integers(1, 3), COUNTS)


@settings(deadline=None, max_examples=15)
@given(CHAINS, SIZES)
def test_grams_are_those_of_the_regressor(chain, size):
    body, states = body_and_states(chain, *size)
    y = body.base_regressor(*states).flatten(1, 2)
    close(gram_of(body, *states), y.mT @ y / size[1], 1e-13)


@settings(deadline=None, max_examples=12)
@given(CHAINS, COUNTS)
def test_sums_are_those_of_the_regressor(chain, count):
    body, states = body_and_states(chain, count)
    torque = normal(count, body.joints)
    rows = torch.cat([body.base_regressor(*states), torque[..., None]], 2).transpose(0, 1)
    close(body.sums(*states, torque), rows.mT @ rows, 1e-13)


@settings(deadline=None, max_examples=15)
@given(CHAINS, SIZES, st.integers(1, 4))
def test_slopes_of_torques_are_pinocchios(chain, size, sets):
    """Of several multiples of the arm's own parameters."""
    (body, states), (_, model) = body_and_states(chain, *size), random_chain(*chain)
    factors, cotangent = normal(size[0], sets), normal(size[0], sets, size[1], body.joints)
    x, data = [part.requires_grad_(True) for part in states], model.createData()
    torques = body.torques_of(*x, factors[:, :, None] * body.arm.inertial_parameters.flatten())
    push = torch.einsum("bk,bktj->btj", factors, cotangent).flatten(0, 1).numpy()
    rows = zip(push, *(part.detach().flatten(0, 1).numpy() for part in states))
    slopes = [[one @ y for y in pin.computeRNEADerivatives(model, data, *state)] for one, *state in rows]
    expected = torch.from_numpy(np.array(slopes)).reshape(*size, 3, body.joints).unbind(2)
    close(torch.autograd.grad(torques, x, cotangent), expected, 1e-11)


def cost_of(body, states, limits):
    """What exceeds limits, by its definition, (B,)."""
    middle, room, speed, most, own = map(torch.from_numpy, limits[3:])
    torque = body.torques_of(*states, own.expand(len(states[0]), 1, -1))[:, 0]
    uses = [(states[0] - middle).abs() / room, states[1].abs() / speed]
    uses = [use + limits.reserve for use in uses] + [torque.abs() / most + limits.torque_reserve]
    return limits.weight * sum(((use - 1).clamp_min(0) ** 2).sum((1, 2)) for use in uses)


@settings(deadline=None, max_examples=15)
@given(CHAINS, st.sampled_from([1, 8, 65]), st.floats(0.1, 100.0))
def test_penalised_slopes_are_those_of_torques_and_what_exceeds_limits(chain, count, weight):
    body, states = body_and_states(chain, 2, count)
    sets, weights = normal(2, 3, 10 * body.joints), normal(2, 3)
    tight = torch.full((body.joints,), 0.3, dtype=torch.float64).numpy()  # exceeded by some states
    parameters = body.arm.inertial_parameters.flatten().contiguous().numpy()
    limits = Limits(weight, 0.2, 0.1, 0.1 * tight, tight, 2 * tight, 10 * tight, parameters)
    value, slopes = body.penalised_slopes(states, sets, weights, limits, None)
    x = [part.requires_grad_(True) for part in states]
    cost = cost_of(body, x, limits)
    energy = (weights * body.torques_of(*x, sets).square().sum((2, 3))).sum()
    torch.testing.assert_close(value, cost, rtol=1e-12, atol=1e-12)
    close(slopes, torch.autograd.grad(cost.sum() + energy, x), 1e-12)


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
def test_distances_cost_the_square_of_what_they_lack(arm, region):
    """Slopes by finite differences along random directions."""
    body, (q, dq, ddq) = RigidBody(arm), [x.reshape(2, 40, 7) for x in random_states(arm, 80)]
    constraints = Constraints(arm, [REGIONS[region]])
    near, none = (
        Near(3.0, 0.2, constraints.shapes),
        normal(2, 0, 70),
    )
    weights, limits = normal(2, 0), Limits.none(7)

    def cost(q):
        return body.penalised_slopes([q, dq, ddq], none, weights, limits, near)

    margins = constraints.at_rest(q.flatten(0, 1))
    lack = (0.2 - torch.cat([margins["collision"], margins["keep_out"]], 1)).clamp_min(0)
    value, (slope, *others) = cost(q)
    assert (value > 0).all() and not any(x.any() for x in others)
    torch.testing.assert_close(value, 3.0 * lack.square().sum(1).reshape(2, 40).sum(1))
    for seed in range(3):
        way = normal(2, 40, 7, seed=seed)
        up, down = (cost(q + s * way)[0] for s in (1e-6, -1e-6))
        torch.testing.assert_close((up - down) / 2e-6, (slope * way).sum((1, 2)), rtol=1e-5, atol=1e-5)


def test_slopes_agree_with_finite_differences():
    body, states = body_and_states((4, 1), 2, 2)  # joints that turn and joints that slide
    x = tuple(part.requires_grad_(True) for part in states)
    v = normal(2, 2, 10 * body.joints)
    assert torch.autograd.gradcheck(lambda *s: body.torques_of(*s, v), x)
    assert torch.autograd.gradcheck(body.torque, x)


def test_there_are_no_second_derivatives(planar):
    x = [part.requires_grad_(True) for part in random_states(planar, 2)]
    (slope,) = torch.autograd.grad(RigidBody(planar).torque(*x).square().sum(), x[:1], create_graph=True)
    with pytest.raises(RuntimeError, match="once_differentiable"):
        slope.sum().backward()


@pytest.mark.parametrize("rows", range(1, 10))
def test_a_product_in_tiles_of_four_reads_no_row_that_is_not_there(rows):
    """As plain Python, which refuses what compiled code would read behind the last row."""
    from sidegan.kernels.regressor import tile

    y, product, ends = normal(rows, 7).numpy(), np.zeros((rows, rows)), range(0, rows, 4)
    for i in ends:
        for j in ends:
            tile.__wrapped__(y, (i, rows), (j, rows), 1, 6, product)
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
        q, chain = random_states(other, 1)[0][0], chain_of(other)
        for i, angle in enumerate(q.tolist()):
            turn = 0.0 if other.prismatic[i] else angle
            own = Rotation.from_rotvec(turn * other.axis[i].numpy()).as_matrix()
            mixed = chain.fixed[i] + chain.sine[i] * np.sin(angle) + chain.cosine[i] * np.cos(angle)
            expected = other.rotation[i].numpy() @ own
            np.testing.assert_allclose(mixed, expected.flatten(), atol=1e-14)
            slide = other.rotation[i] @ other.axis[i] * (angle - turn)
            place = chain.origin[i] + chain.slide[i] * angle
            np.testing.assert_allclose(place, other.translation[i] + slide, atol=1e-14)
