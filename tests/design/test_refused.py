"""What the room refuses, each by the words that tell what was expected."""

import math
from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sidegan.design.excitation import condition_of, excite, information_of
from sidegan.design.fidelity import effective_rank, mean_cosine, mean_distance, nearest_distance
from sidegan.design.selection import Selection, a_optimal, d_optimal, greedy
from sidegan.errors import ConfigError, ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

from .conftest import semidefinite, trajectories

NAN, INF = math.nan, math.inf
SIX = semidefinite(0, 6)
FLAT = np.stack([np.diag([1.0, 2.0, 0.0, 1.0])] * 6)


def spoilt(shape, where, value):
    x = np.ones(shape)
    x[where] = value
    return x


def each(work, words, *values):
    """The work with each of some values, and the words by which it is refused."""
    return [(partial(work, x), words) for x in values]


DIVERSITY = (mean_distance, nearest_distance, effective_rank, mean_cosine)
NUMBERS = [
    *each(condition_of, "not finite", np.full((2, 2), NAN)),
    *each(partial(d_optimal, SIX), " of 6", 0, -1, 7),
    *each(partial(a_optimal, count=1), r"expected \(N, q, q\)", SIX[:0], SIX[0]),
    *each(partial(d_optimal, count=2), "no trajectory excites some combination", FLAT),
    *each(partial(d_optimal, count=2), "not finite", spoilt((5, 4, 4), 2, NAN), spoilt((5, 4, 4), 2, INF)),
    *each(partial(greedy, np.ones((3, 2))), " of 3", 0, -1, 4),
    *each(partial(greedy, count=1), r"\(N, p\)", *map(np.ones, [(3,), (3, 2, 2), (3, 0)])),
    *each(
        partial(greedy, count=2), r"diagonal\[2\]", *(spoilt((4, 2), (2, 1), x) for x in (NAN, INF, -1e-3))
    ),
    *each(partial(greedy, count=1), "of 0", np.ones((0, 2))),
    *((partial(x, np.zeros((1, 7))), "at least 2 rows") for x in DIVERSITY),
]


@pytest.mark.parametrize(("work", "words"), NUMBERS)
def test_invalid_arrays_and_counts_are_refused(work, words):
    with pytest.raises(ShapeError, match=words):
        work()


@pytest.mark.parametrize("measure", [excite, information_of])
def test_invalid_coefficients_are_refused(planar, measure):
    body, (trajectory, c) = RigidBody(planar), trajectories(2)
    for wrong, words in ((c[0], "coefficients are"), (spoilt(c.shape, 3, NAN), r"coefficients\[3\]")):
        with pytest.raises(ShapeError, match=words):
            measure(body, trajectory, wrong)
    with pytest.raises(ShapeError, match=r"expected \(…, 2\)"):
        measure(body, *trajectories(7))


@pytest.mark.parametrize("noise", [[1.0], [1.0, 0.0], [1.0, NAN], [1.0] * 3])
def test_invalid_noise_is_refused(planar_problem, random, noise):
    c = planar_problem.start(2, random)
    with pytest.raises(ShapeError, match="expected 2 positive deviations"):
        information_of(planar_problem.body, planar_problem.trajectory, c, noise=noise)


def test_noise_is_refused_for_a_score_without_noise():
    with pytest.raises(ConfigError, match="greedy score ignores noise"):
        Selection(noise=[3.0, 0.5])


def test_too_few_samples_are_refused(planar_problem):
    for harmonics in (1, 2, 6, 9):
        problem = partial(replace, planar_problem, trajectory=Trajectory(2, harmonics))
        assert problem(samples=2 * harmonics + 1).samples
        with pytest.raises(ShapeError, match=f"cannot resolve {harmonics} harmonics"):
            problem(samples=2 * harmonics)
