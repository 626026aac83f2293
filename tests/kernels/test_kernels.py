"""Compiled kernels against Pinocchio, definitions and finite differences."""

import math

import numpy as np
import pinocchio as pin
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.base.threads import on_threads
from sidegan.kernels import dynamics
from sidegan.kernels.dynamics import PenaltyLimits
from sidegan.kernels.information import no_terms, signals_for, weighted_slopes
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory
from tests.chains import random_chain, random_states
from tests.motion.conftest import close, normal

CHAINS = st.tuples(st.integers(1, 9), st.integers(0, 30))
COUNTS = st.sampled_from([1, 8, 63, 65, 130])  # around the number of lanes, and more than a span
SIZES = st.tuples(st.integers(1, 3), COUNTS)


def body_and_states(chain, *shape):
    """A random chain and states of it, three arrays of (*shape, J)."""
    arm, _ = random_chain(*chain)
    count = math.prod(shape)
    return RigidBody(arm), [x.reshape(*shape, arm.joints) for x in random_states(arm, count, chain[1])]


@settings(max_examples=15)
@given(CHAINS, SIZES)
def test_weighted_grams_and_sums_are_those_of_the_regressor(chain, size):
    body, states = body_and_states(chain, *size)
    y, torque = body.base_regressor(*states), normal(*size, body.joints)
    certainty = np.linspace(0.5, 2.0, body.joints)
    rows = (certainty[:, None] * y).reshape(len(y), -1, y.shape[-1])
    grams = body.grams(*states, certainty)
    close(grams, rows.mT @ rows / size[1], 1e-13)
    rows = np.concatenate([y, torque[..., None]], 3)[0].swapaxes(0, 1)
    close(body.sums(*(x[0] for x in states), torque[0]), rows.mT @ rows, 1e-13)


@settings(max_examples=15)
@given(CHAINS, COUNTS, st.integers(1, 4))
def test_gradients_of_energies_agree_with_pinocchio(chain, count, sets):
    """Of several multiples of the arm's own parameters, with weighted joints."""
    (body, states), (_, model) = body_and_states(chain, 1, count), random_chain(*chain)
    joints, own = body.joints, body.arm.inertial_parameters.ravel()
    factors, weights = normal(sets), normal(sets, seed=1)
    roots = np.linspace(0.5, 2.0, joints)
    ones = np.ones(joints)
    limits = PenaltyLimits(0.0, 0.0, 0.0, 0.0, ones, ones, ones, ones, own, ones, ones)
    extra = no_terms(joints)._replace(roots=roots)
    q, dq, ddq = (x[0].T for x in states)
    packed = np.ascontiguousarray(np.stack([np.sin(q), np.cos(q), q, dq, ddq])[:, None])
    slope, directions = np.zeros((3, joints, count)), (np.outer(factors, own), weights)
    terms = extra, signals_for(extra, count, sets)
    cost = weighted_slopes(
        body.chain, limits, packed, terms, directions, slope, dynamics.dynamics_buffers(body.chain)
    )
    assert cost == 0
    data, expected, scale = model.createData(), np.zeros((3, joints, count)), 2 * (weights @ factors**2)
    for n in range(count):
        state = q[:, n], dq[:, n], ddq[:, n]
        torque = pin.rnea(model, data, *state)
        for k, part in enumerate(pin.computeRNEADerivatives(model, data, *state)):
            expected[k, :, n] = scale * (roots**2 * torque) @ part
    close(slope, expected, 1e-11)


@pytest.mark.parametrize("rows", range(1, 10))
def test_a_tiled_product_reads_no_row_out_of_bounds(rows):
    """As plain Python, which refuses what compiled code would read behind the last row."""
    from sidegan.kernels.regressor import tile

    y, product, ends = normal(rows, 7), np.zeros((rows, rows)), range(0, rows, 4)
    for i in ends:
        for j in ends:
            tile.__wrapped__(y, (i, rows), (j, rows), 1, 6, product)
    np.testing.assert_allclose(product, y[:, 1:6] @ y[:, 1:6].T, atol=1e-14)


def test_results_do_not_depend_on_threads_or_batches(arm):
    body, trajectory = RigidBody(arm), Trajectory(7)
    c, states = 0.2 * normal(60, *trajectory.shape), random_states(arm, 4001)
    torque = normal(4001, 7)
    grams, sums = gram(body, trajectory, c), body.sums(*states, torque)
    with on_threads(2):
        np.testing.assert_allclose(gram(body, trajectory, c), grams, rtol=1e-13, atol=1e-12)
        close(body.sums(*states, torque), sums, 1e-13)
    np.testing.assert_allclose(gram(body, trajectory, c[7:8]), grams[7:8], rtol=1e-13, atol=1e-12)


@pytest.mark.parametrize("shape", [(0, 5, 7), (2, 0, 7)])
def test_empty_batches_give_empty_results(arm, shape):
    q = np.zeros(shape)
    assert RigidBody(arm).torque(q, q, q).shape == shape
    assert gram(RigidBody(arm), Trajectory(7), np.zeros((0, 7, 6, 2))).shape == (0, 43, 43)
