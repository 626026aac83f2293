"""Tables of results for people, and the words that they share with figures."""

import pandas as pd
import pytest

from sidegan.report import tables

SETS = ["single long, 6 harmonics", "seeds", "seeds + vanilla"]
KNOWN = {"success": 0.5, "condition": 100.0, "condition_valid": 90.0, "distance": 2.0, "nearest": 1.0}


@pytest.fixture
def raw():
    rows = [
        (seed, name, repeat, weighted, joint, value)
        for seed in (0, 1)
        for name, value in (("vanilla", 0.2), ("seeds", 0.4), ("long-6", 0.8))
        for repeat in (0, 1)
        for weighted in (False, True)
        for joint in ("b", "a")
    ]
    frame = pd.DataFrame(rows, columns=["seed", "set", "repeat", "weighted", "joint", "nmse"])
    frame.nmse *= 1 + frame.repeat
    frame.loc[frame.weighted, "nmse"] = 77.0
    facts = {"training": 0, "duration": 16.0, "samples": 321, "condition": 1234.5}
    return frame.assign(**facts, covariance_norm=frame.repeat + 1.0)


def test_sets_follow_the_papers_order_unknown_ones_last():
    names = ["zeta", "diagonal", "alpha", "seeds", "long-210", "eigen", "long-12", "long-6", "vanilla"]
    expected = ["long-6", "long-12", "long-210", "seeds", "vanilla", "eigen", "diagonal", "alpha", "zeta"]
    assert tables.ordered(names) == tables.ordered(reversed(names)) == expected


@pytest.mark.parametrize(
    ("values", "expected"),
    [
        ([], "—"),
        ([0.123456, None], "0.123"),
        ([1, 3], "2 ± 1.4"),
        ([0.001, 0.001], "0.001 ± 0"),
        ([1e-7, 3e-7], "2e-7 ± 1.4e-7"),
        ([84.4, 270.4], "180 ± 130"),  # no more digits than the deviation has
        ([187.1, 189.1], "188 ± 1.4"),
        ([-0.3, 0.76], "0.23 ± 0.75"),
        ([60.4882, 60.8134], "60.7 ± 0.23"),  # rounded once
        ([-90.0, 98.0], "0 ± 130"),
    ],
)
def test_a_spread_is_the_mean_and_the_sample_deviation(values, expected):
    assert tables.spread(pd.Series(values, dtype=float)) == expected


def test_joints_keep_their_order_and_take_the_unweighted_mean(raw):
    table = tables.joints(raw)
    assert list(table.index) == ["b", "a"] and list(table.columns) == SETS
    assert table.loc["a"].tolist() == ["1.2", "0.6", "0.3"]


def test_set_facts_are_averaged(raw):
    table = tables.excitation_sets(raw)
    assert list(table.index) == SETS
    assert table.loc["seeds"].tolist() == ["16", "321", "1234", "1.5"]


def test_generators_show_known_values():
    eigen = KNOWN | {"name": "eigen", "valid_share": 0.9, "gain": 12.3456, "rank_uncentred": None}
    seeds = {"name": "seeds", "valid": 1.0, "condition": 80.0, "distance": 3.0, "rank_uncentred": 5.0}
    seeds |= {"told_apart": 0.5, "gain": 1.0}
    frame = pd.DataFrame([seeds, eigen, eigen | {"condition": 300.0}, seeds | {"name": "search-40"}])
    table = tables.generators(frame)
    assert list(table.index) == ["search-40", "seeds", "eigen"]
    assert table.loc["eigen"].tolist()[:4] == ["0.9 ± 0", "200 ± 140", "90 ± 0", "12.3 ± 0"]
    assert table.loc["eigen"].tolist()[-1] == "—"
    assert table.loc["seeds"].tolist() == ["1", "80", "80", "1", "3", "5"]
    assert tables.likeness(frame)[tables.LIKENESS["told_apart"]].tolist() == ["0.5", "0.5", "—"]
