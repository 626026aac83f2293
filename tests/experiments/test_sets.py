"""Sets in tables: their order, labels and colours, and what the tables show of them."""

import pandas as pd
import pytest

from experiments import tables
from experiments.sets import colour, colours, sort_sets, title

LABELS = ["single long, 6 harmonics", "seeds", "seeds + vanilla"]
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
    assert sort_sets(names) == sort_sets(reversed(names)) == expected


@pytest.mark.parametrize("name", ["long-horizon", "search", "boxed-in", "seeds-only"])
def test_a_variant_may_be_called_almost_like_another_set(name):
    assert sort_sets([name, "long-6", "seeds"]) == ["long-6", "seeds", name]
    assert title(name) == f"seeds + {name}" and colours([name]) == [colour(name)]


def test_joints_keep_their_order_and_take_the_unweighted_mean(raw):
    table = tables.joint_table(raw)
    assert list(table.index) == ["b", "a"] and list(table.columns) == LABELS
    assert table.loc["a"].tolist() == ["1.2", "0.6", "0.3"]


def test_set_facts_are_averaged(raw):
    table = tables.excitation_table(raw)
    assert list(table.index) == LABELS
    assert table.loc["seeds"].tolist() == ["16", "321", "1234", "1.5"]


def test_generators_show_known_values():
    eigen = KNOWN | {"name": "eigen", "valid_share": 0.9, "gain": 12.3456, "rank_uncentred": None}
    seeds = {"name": "seeds", "valid": 1.0, "condition": 80.0, "distance": 3.0, "rank_uncentred": 5.0}
    seeds |= {"told_apart": 0.5, "gain": 1.0}
    frame = pd.DataFrame([seeds, eigen, eigen | {"condition": 300.0}, seeds | {"name": "search-40"}])
    table = tables.generator_table(frame)
    assert list(table.index) == ["search-40", "seeds", "eigen"]
    assert table.loc["eigen"].tolist()[:4] == ["0.9 ± 0", "200 ± 140", "90 ± 0", "12.3 ± 0"]
    assert table.loc["eigen"].tolist()[-1] == "—"
    assert table.loc["seeds"].tolist() == ["1", "80", "80", "1", "3", "5"]
    assert tables.likeness_table(frame)[tables.LIKENESS["told_apart"]].tolist() == ["0.5", "0.5", "—"]
