"""Robot seconds, and intervals over plants and sets."""

import numpy as np
import pytest

from experiments import worth_tables
from sidegan.worth.score import Estimate, estimate, ratio, resampled, seconds_within

TIMES = np.array([4.0, 8.0, 16.0, 32.0])


@pytest.mark.parametrize(
    ("errors", "expected"),
    [
        ([4, 2, 1, 0.5], 8.0),
        ([1, 1, 1, 1], 4.0),  # from the first time on
        ([8, 1, 8, 1], 16 * 2 ** (2 / 3)),  # it has to stay there
        ([9, 9, 9, 3], np.inf),
        ([8, 4, 1, 1], 8 * 2**0.5),  # halfway on the logarithms' line
    ],
)
def test_the_time_from_which_on_the_error_stays(errors, expected):
    found = seconds_within(TIMES, np.array(errors, dtype=float), np.array(2.0))
    assert found == pytest.approx(expected)


def test_each_plant_has_a_mark_of_its_own():
    errors = np.array([[[4.0, 2, 1, 1]], [[4.0, 2, 1, 1]]])
    assert seconds_within(TIMES, errors, np.array([[2.0], [4.0]])).ravel().tolist() == pytest.approx([8, 4])


def test_intervals_hold_the_median_and_grow_with_the_spread():
    random = np.random.default_rng(0)
    narrow, wide = (estimate(50 + s * random.standard_normal((10, 5)), 300) for s in (1, 10))
    for one in (narrow, wide):
        assert one.low <= one.median <= one.high
    assert wide.high - wide.low > 3 * (narrow.high - narrow.low)


def test_ratios_are_paired():
    """Plants that are hard for both do not widen the ratio of the two."""
    hard = np.exp(2 * np.random.default_rng(0).standard_normal((10, 1))) * np.ones((10, 5))
    one = ratio(0.5 * hard, hard, 300)
    assert one == pytest.approx((0.5, 0.5, 0.5))
    assert estimate(hard, 300).high > 1.5 * estimate(hard, 300).low


def test_who_never_arrives_is_infinite():
    some = np.array([[np.inf, 10.0], [np.inf, np.inf]])
    assert np.isinf(estimate(some, 50).median)
    assert ratio(some, some, 50).median == 1.0
    assert ratio(np.full((2, 2), 3.0), np.full((2, 2), np.inf), 50).median == 0.0
    assert resampled(some, 7, np.random.default_rng(0)).shape == (7,)


@pytest.mark.parametrize(
    "medians, said",
    [
        ((0.5, 0.4, 0.75), "0.5 × (0.4 … 0.75)"),
        ((1.0, 1.0, 1.0), "neither arrives"),
        ((1.0, 0.0, 1.0), "neither by the median"),  # in some draws ours arrive alone
        ((1.0, 1.0, np.inf), "neither by the median"),
        ((0.0, 0.0, 1.0), "theirs never"),
        ((np.inf, 1.0, np.inf), "ours never"),
        ((1.0, 0.5, np.inf), "neither by the median"),
    ],
)
def test_a_ratio_is_told_to_people(medians, said):
    assert worth_tables.quotient(Estimate(*medians)) == said
