import pytest

from sidegan.report.style import colours, seconds


@pytest.mark.parametrize(
    ("duration", "expected"),
    [
        (4e-5, "40 µs"),
        (1.4e-3, "1.4 ms"),
        (2, "2 s"),
        (360, "6 min"),
        (14 * 3600, "14 h"),
        (float("nan"), "not measured"),
    ],
)
def test_durations_are_said_as_people_do(duration, expected):
    assert seconds(duration) == expected


def test_sets_have_their_own_colour_and_other_groups_one_each():
    sets = colours(["eigen", "long-210", "seeds"])
    assert list(sets) == ["long-210", "seeds", "eigen"]
    assert sets["eigen"] == colours(["eigen"])["eigen"]
    others = colours(["gradient", "gaco", "eigen", "gaco"])
    assert list(others) == ["gradient", "gaco", "eigen"] and len(set(others.values())) == 3
