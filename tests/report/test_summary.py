import numpy as np
import pandas as pd
import pytest

from sidegan.errors import ConfigError, ShapeError
from sidegan.report.style import colours, lighter, seconds
from sidegan.report.summary import aligned, by_joint, curves, durations, epochs


def test_epochs_are_as_long_as_the_longest_training_and_skip_what_is_unknown():
    line = epochs([[{"a": 1.0}, {"a": None}, {"a": 5.0}], [{"a": 3.0}, {"a": 7.0}]], "a")
    np.testing.assert_array_equal(line.x, [1, 2, 3])
    np.testing.assert_array_equal(line.mean, [2, 7, 5])
    np.testing.assert_array_equal(line.low, [1, 7, 5])
    np.testing.assert_array_equal(line.high, [3, 7, 5])
    assert np.isnan(epochs([[{}]], "a").mean).all()
    assert len(epochs([], "a").x) == 0


def test_a_curve_goes_through_the_means_in_order_and_knows_the_range():
    frame = pd.DataFrame({"n": [10, 5, 10, 5], "e": [4.0, 1.0, 8.0, np.nan], "who": ["a", "a", "a", "b"]})
    found = curves(frame, "n", "e", "who")
    assert list(found) == ["a"]
    for values, expected in zip(found["a"], ([5, 10], [1, 6], [1, 4], [1, 8])):
        np.testing.assert_array_equal(values, expected)
    assert list(curves(frame, "n", "e", None)) == [""]


def test_places_of_text_keep_their_order_and_are_the_same_for_all():
    frame = pd.DataFrame({"case": ["z", "a", "a", "k"], "e": [1.0, 2, 3, 4], "who": ["p", "p", "q", "q"]})
    found = aligned(curves(frame, "case", "e", "who"))
    assert list(found["p"].x) == list(found["q"].x) == ["z", "a", "k"]
    np.testing.assert_array_equal(found["p"].mean, [1, 2, np.nan])
    np.testing.assert_array_equal(found["q"].high, [np.nan, 3, 4])


def test_joints_keep_their_order_and_sets_take_the_papers():
    frame = pd.DataFrame({"set": ["eigen", "long-6"] * 2, "joint": list("bbaa"), "nmse": [1.0, 2, 3, 4]})
    found = by_joint(frame)
    assert list(found) == ["long-6", "eigen"]
    assert list(found["eigen"].x) == ["b", "a"] and list(found["eigen"].mean) == [1, 3]


def test_data_that_cannot_be_drawn_are_refused():
    frame = pd.DataFrame({"n": [1.0], "e": [np.nan]})
    with pytest.raises(ConfigError, match="no column who, only n, e"):
        curves(frame, "n", "e", "who")
    with pytest.raises(ShapeError, match="no row knows both n and e"):
        curves(frame, "n", "e", None)


def test_durations_leave_room_on_both_sides():
    low, high = durations(pd.DataFrame({"what": ["a", "b"], "ours": [1.0, None], "paper": [60.0, 3600.0]}))
    assert low < 1 and high > 3600


@pytest.mark.parametrize("ours", [[None], [0.0], [-1.0]])
def test_durations_that_have_no_logarithm_are_refused(ours):
    with pytest.raises(ShapeError, match="positive"):
        durations(pd.DataFrame({"what": ["a"], "ours": ours, "paper": [None]}, dtype=object))


@pytest.mark.parametrize(
    ("duration", "expected"),
    [(4e-5, "40 µs"), (1.4e-3, "1.4 ms"), (2, "2 s"), (360, "6 min"), (14 * 3600, "14 h")],
)
def test_durations_are_said_as_people_do(duration, expected):
    assert seconds(duration) == expected


def test_sets_have_their_own_colour_and_other_groups_one_each():
    sets = colours(["eigen", "long-210", "seeds"])
    assert list(sets) == ["long-210", "seeds", "eigen"]
    assert sets["eigen"] == colours(["eigen"])["eigen"]
    others = colours(["gradient", "gaco", "eigen", "gaco"])
    assert list(others) == ["gradient", "gaco", "eigen"] and len(set(others.values())) == 3
    assert lighter("#ff8000", 0.25) == "rgba(255, 128, 0, 0.25)"
