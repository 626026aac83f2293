"""Bounds over a cell are true bounds: what moves or changes in it stays below them."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from sidegan.base.arrays import Array
from sidegan.robot import Arm
from sidegan.validity import Constraints
from sidegan.validity.bounds import reaches
from tests.chains import random_chain, random_states
from tests.oracle import chain_model

from .critical import capsule_axes, only

CHAINS = [0, 1, 2, 3, 5, 9]  # joints; 0: the LWR
ROUNDING = 1e-9
_STEP = 1e-5  # [rad or m] of differences


@pytest.fixture
def chain(request: pytest.FixtureRequest, arm: Arm) -> Arm:
    """A random chain, or the LWR; in the longest chain slides reach far, and mostly downwards."""
    chain = random_chain(request.param, 0)[0] if request.param else arm
    if chain.joints < 9:
        return chain
    lower, upper = -chain.position_upper, -chain.position_lower
    return replace(chain, translation=0.1 * chain.translation, position_lower=lower, position_upper=upper)


def bounds(arm: Arm, *rates: Array) -> np.ndarray:
    """Bounds of torques' rates and second derivatives, (2, N, J), of an arm and its rates, (N, J) each."""
    from sidegan.kernels import cells
    from sidegan.validity.search import model_of

    model = model_of(Constraints(replace(arm, capsules=only(arm.capsules, np.arange(0)))))
    speed, acceleration, jerk, snap = (np.abs(x) for x in rates)
    drifts, nothing = np.stack([snap, snap]), (np.zeros((1, 1, 1)), np.zeros((1, 5, 1)), np.zeros(1))
    motions = cells.Motions(nothing[0], jerk, drifts, nothing[1], nothing[2], 0.1)
    found, sums = np.zeros((2, *speed.shape)), np.zeros((6, arm.joints))
    for n, (v, a) in enumerate(zip(speed, acceleration)):
        motion, bent = np.stack([0 * v, 0 * v, v, a]), np.zeros((2, arm.joints))
        cells.bend_torques(model, motion, motions, n, sums, bent)
        found[:, n] = bent
    return found


def rates_of(arm: Arm, *states: Array) -> np.ndarray:
    """Rates of the torques, (N, J), of positions and three derivatives (N, J), by Pinocchio's slopes."""
    model, rates = chain_model(arm), []
    data = model.createData()
    for q, *rest in zip(*states):
        slopes = pin.computeRNEADerivatives(model, data, q, *rest[:2])
        rates.append(sum(slope @ rate for slope, rate in zip(slopes, rest)))
    return np.array(rates)


def shifted(states: Sequence[Array], time: Array) -> list[Array]:
    """Positions and three derivatives after times (N, 1) [s], given four."""
    return [sum(x * time**k / math.factorial(k) for k, x in enumerate(states[order:])) for order in range(4)]


@pytest.mark.parametrize("chain", CHAINS, indirect=True)
def test_torque_rates_stay_within_their_bounds(chain: Arm) -> None:
    """From gravity alone to inertia alone."""
    q, dq, ddq = random_states(chain, 300, chain.joints)
    size = np.logspace(-2, 2, 300)[:, None]
    generator = np.random.default_rng(chain.joints)
    higher = generator.standard_normal((2, *ddq.shape)) * size**2
    states = (q, dq * size, ddq * size[::-1], *higher)
    step = 1e-5 / np.maximum(size, 1.0)
    up, down = (rates_of(chain, *shifted(states, s * step)) for s in (1, -1))
    most, bend = bounds(chain, *states[1:])
    assert (np.abs(rates_of(chain, *states[:4])) <= most * (1 + ROUNDING)).all()
    assert (np.abs(up - down) / (2 * step) <= bend * (1 + 1e-4) + 1e-4).all()


@pytest.mark.parametrize("chain", CHAINS, indirect=True)
def test_capsule_points_move_no_faster_than_their_reach(chain: Arm) -> None:
    q = random_states(chain, 200)[0].T
    capsules = np.arange(len(chain.capsules.link))
    _, _, reach = reaches(chain, np.zeros((0, 2), int), np.stack([capsules, capsules], 1))
    for joint in range(chain.joints):
        push = np.zeros_like(q)
        push[joint] = 1.0
        ahead, behind = (np.stack(capsule_axes(chain, q + s * _STEP * push)) for s in (1, -1))
        speeds = (ahead - behind) / (2 * _STEP)
        fastest = np.stack([np.linalg.norm(x, axis=0).max(1) for x in speeds]).max(0)
        assert (fastest <= reach[:, joint] + ROUNDING).all()
        own = chain.capsules.link == joint  # one joint away the bound is exact
        np.testing.assert_allclose(fastest[own], reach[own, joint], atol=1e-7)
