"""Measures of diversity and likeness: closed answers, and which of them sees through which cheat."""

import math

import numpy as np
import pytest

from sidegan.design import fidelity
from sidegan.design.fidelity import (
    beyond,
    classifier_accuracy,
    density_and_coverage,
    distance_to,
    diversity,
    effective_rank,
    mean_cosine,
    mean_distance,
    nearest_distance,
    proportions,
)

N, D, BOX, NOISE, OFFSET = 300, 24, 0.2, 0.01, 0.3
OTHER, HALF = np.random.default_rng(0).uniform(-BOX, BOX, (2, N, 2, D // 4, 2))
SPREAD = BOX * math.sqrt(D / 3)  # root mean square of a row's size

MEASURES = {
    "distance": mean_distance,
    "nearest": nearest_distance,
    "rank": effective_rank,
    "rank, uncentred": lambda x: proportions(x)["rank_uncentred"],
    "cosine": lambda x: proportions(x)["cosine"],
    "norm": lambda x: proportions(x)["norm"],
    "beyond": lambda x: beyond(x, OTHER),
    "nearest seed": lambda x: distance_to(x, OTHER),
    "density": lambda x: density_and_coverage(x, OTHER)[0],
    "coverage": lambda x: density_and_coverage(x, OTHER)[1],
    "told apart": lambda x: classifier_accuracy(x, OTHER),
}
APART = 0.66 * math.sqrt(2) * SPREAD  # the nearest of so many, as a share of the mean
# What a good set has, such as the seeds' other half …
GOOD = {
    "distance": pytest.approx(math.sqrt(2) * SPREAD, rel=0.02),
    "nearest": pytest.approx(APART, rel=0.05),
    "rank": pytest.approx(D, rel=0.07),
    "rank, uncentred": pytest.approx(D, rel=0.07),
    "cosine": pytest.approx(0, abs=0.01),
    "norm": pytest.approx(SPREAD, rel=0.03),
    "beyond": pytest.approx(2 / (N + 1), abs=0.003),
    "nearest seed": pytest.approx(APART, rel=0.05),
    "density": pytest.approx(1, abs=0.1),
    "coverage": pytest.approx(1 - 2**-5, abs=0.03),
    "told apart": pytest.approx(0.5, abs=0.06),
}
# … and the measures by which others are seen; by the rest they pass as good ones do.
SEEN = {
    "the seeds' other half": (HALF, set()),
    "copies of one": (np.broadcast_to(HALF[:1], HALF.shape), MEASURES.keys() - {"nearest seed"}),
    # A look at the seeds themselves is what tells.
    "copies of seeds with a little noise": (
        OTHER + NOISE / BOX * HALF,
        {"nearest seed", "beyond", "coverage"},
    ),
    # Distances, nearest ones and the centred rank do not see it.
    "seeds and an offset": (HALF + OFFSET, MEASURES.keys() - {"distance", "nearest", "rank"}),
    # They are within many neighbourhoods, cover all, and have the same ranks.
    "seeds at half their size": (
        HALF / 2,
        MEASURES.keys() - {"rank", "rank, uncentred", "cosine"},
    ),
}


@pytest.mark.parametrize("name", SEEN)
def test_every_kind_of_poor_set_is_detected_by_a_measure(name):
    x, seen = SEEN[name]
    assert {key for key, measure in MEASURES.items() if measure(x) != GOOD[key]} == seen


def test_the_classifier_tells_apart_what_differs_in_one_way():
    assert classifier_accuracy(HALF + OFFSET, OTHER) == 1.0
    assert classifier_accuracy(HALF / 2, OTHER) == pytest.approx(0.95, abs=0.03)


def test_density_and_coverage_by_hand():
    """Six points on a line, each of whose neighbourhoods reaches to the end that is further away."""
    other = np.arange(6.0)[:, None]
    assert density_and_coverage(other, other) == (pytest.approx(6 / 5), 1.0)
    assert density_and_coverage(np.array([[8.0]]), other) == (pytest.approx(2 / 5), pytest.approx(2 / 6))
    assert density_and_coverage(np.array([[11.0]]), other) == (0.0, 0.0)


def test_mean_cosine_of_parallel_and_zero_rows():
    assert mean_cosine(np.array([[1.0, 0.0], [-2.0, 0.0], [0.0, 3.0]])) == pytest.approx(-1 / 3)
    assert mean_cosine(np.zeros((3, 2))) == 0.0


@pytest.mark.parametrize(
    ("x", "mean", "nearest"),
    [
        (np.array([[0.0, 0.0], [3.0, 0.0], [0.0, 4.0], [3.0, 4.0]]), (2 * 3 + 2 * 4 + 2 * 5) / 6, 3.0),
        (np.eye(12).reshape(12, 2, 3, 2), math.sqrt(2), math.sqrt(2)),
        (np.array([[0.0], [10.0]] * 5), 10 * 25 / 45, 0.0),  # modes far apart
    ],
)
def test_distances_by_hand(x, mean, nearest):
    assert mean_distance(x) == pytest.approx(mean)
    assert nearest_distance(x) == pytest.approx(nearest)


@pytest.mark.parametrize(
    ("squares", "rank"),
    [([], 0.0), ([1], 1.0), ([1] * 7, 7.0), ([3, 1], 4 / 3**0.75)],  # exp of the entropy of ¾ and ¼
)
def test_effective_rank_by_hand(squares, rank):
    steps = np.diag(np.sqrt(squares + [0.0] * (9 - len(squares))))
    assert effective_rank(np.concatenate([steps, -steps]) + 100.0) == pytest.approx(rank)


def test_effective_rank_does_not_depend_on_scale_or_basis():
    generator = np.random.default_rng(0)
    x = generator.standard_normal((200, 6)) * np.arange(1, 7)
    turn = np.linalg.qr(generator.standard_normal((6, 6)))[0]
    assert effective_rank(1e-7 * x @ turn - 5.0) == pytest.approx(effective_rank(x), rel=1e-6)


def test_a_single_trajectory_has_no_diversity():
    single = np.zeros((1, 2, 3, 2))
    assert diversity(single, np.ones((1, 8))) == {}


def test_a_sample_of_a_large_set_gives_nearly_the_same_measures(monkeypatch):
    x = np.random.default_rng(0).standard_normal((3000, 2, 3, 2))
    exact = nearest_distance(x), mean_distance(x)
    monkeypatch.setattr(fidelity, "_EXACT", 2999)
    monkeypatch.setattr(fidelity, "_PAIRED", 1000)
    assert (nearest_distance(x), mean_distance(x)) == pytest.approx(exact, rel=0.03)
    assert nearest_distance(x) != exact[0]
