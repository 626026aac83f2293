import json
import math

import pytest

from benchmarks import data, run, timing
from benchmarks.timing import ROWS, Result, Timing


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmarks") / "result.json"
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(data, "_LIBRARY", 6000)
        assert run.main(["--quick", "--repeats", "1", "--json", str(path)]) == 0
    return json.loads(path.read_text(encoding="utf-8"))


def test_every_row_is_there_and_positive(result):
    assert [row["name"] for row in result["rows"]] == list(run.BENCHMARKS)
    for row in result["rows"]:
        for key in ("ours", "by_cpu", "opponent", "ratio", "goal"):
            assert math.isfinite(row[key]) and row[key] > 0, row
        assert row["unit"] and row["against"] and row["threads"] in (1, 2)
        assert isinstance(row["reached"], bool)


def test_a_row_holds_what_others_read(result):
    keys = "name ours unit opponent against ratio goal reached threads by_cpu also"
    assert all(set(row) == set(keys.split()) for row in result["rows"])


def test_the_names_are_those_that_others_read(result):
    names = "regressor gradient validity generation generate_validate seeds training rls greedy design"
    names += " evaluation paper_seeds design_evaluation design_setup design_8ms design_12ms"
    names += " design_50ms_worst design_next set_of_35"
    assert [row["name"] for row in result["rows"]] == names.split()


def test_the_machine_is_named(result):
    assert result["quick"] is True
    assert result["machine"]["cpu"] and result["machine"]["cores"] >= 1
    assert result["machine"]["torch"] and result["machine"]["python"]


@pytest.fixture
def rows(monkeypatch):
    """A rate and a cost, as rows.yaml would describe them."""
    words = {"unit": "x", "threads": 1, "against": "y"}
    monkeypatch.setitem(ROWS, "rate", {**words, "more": True, "goal": 15.0})
    monkeypatch.setitem(ROWS, "cost", {**words, "more": False, "goal": 9.0})


def test_a_ratio_above_one_is_better_in_both_directions(rows):
    run = Timing(wall=2.0, cpu=4.0)
    keys = ("ours", "by_cpu", "ratio", "reached")
    more = timing.row("rate", Result(run, 40.0, opponent=10.0))
    assert [more[key] for key in keys] == [20.0, 10.0, 2.0, True]
    less = timing.row("cost", Result(run, 5.0, opponent=20.0))
    assert [less[key] for key in keys] == [10.0, 20.0, 2.0, False]


def test_the_table_shows_every_row(capsys):
    also = {"another": "none became valid", "a third": 5.0}
    run.show([timing.row("regressor", Result(Timing(2.0, 2.0), 6e5, 1e5, also=also))], quick=False)
    shown = capsys.readouterr().out
    assert all(word in shown for word in ("300,000", "3", "none became valid", "a third"))


@pytest.mark.parametrize("arguments", [["--only", "nothing"], ["--repeats", "0"]])
def test_a_wrong_option_is_refused(arguments, capsys):
    with pytest.raises(SystemExit) as stopped:
        run.main(arguments)
    assert stopped.value.code == 2
    assert arguments[0] in capsys.readouterr().err


def test_one_benchmark_alone(tmp_path):
    assert (
        run.main(["--quick", "--repeats", "1", "--only", "greedy", "--json", str(tmp_path / "x.json")]) == 0
    )
    assert len(json.loads((tmp_path / "x.json").read_text())["rows"]) == 1
