import json
import math

import pytest
import torch

from benchmarks import run
from benchmarks.limits import operations
from benchmarks.timing import Timing, cost, rate


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmarks") / "result.json"
    assert run.main(["--quick", "--repeats", "1", "--json", str(path)]) == 0
    return json.loads(path.read_text(encoding="utf-8"))


def test_every_row_is_there_and_positive(result):
    assert [row["name"] for row in result["rows"]] == list(run.BENCHMARKS)
    for row in result["rows"]:
        for key in ("ours", "by_cpu", "opponent", "ratio", "goal"):
            assert math.isfinite(row[key]) and row[key] > 0, row
        assert row["limit"] is None or (row["limit"] > 0 and row["share"] > 0 and row["limit_is"])
        assert row["unit"] and row["against"] and row["threads"] in (1, 2)
        assert isinstance(row["reached"], bool)


def test_the_names_are_those_that_others_read(result):
    names = "regressor gradient validity generation generate_validate seeds training rls greedy design"
    assert [row["name"] for row in result["rows"]] == names.split()


def test_the_machine_is_named(result):
    assert result["quick"] is True
    assert result["machine"]["cpu"] and result["machine"]["cores"] >= 1
    assert result["machine"]["torch"] and result["machine"]["python"]


WORDS = {"against": "y", "limit_is": "z", "threads": 1}


def test_a_ratio_above_one_is_better_in_both_directions():
    run = Timing(wall=2.0, cpu=4.0)
    more = rate("x", "1/s", 40.0, run, opponent=10.0, limit=80.0, goal=15.0, **WORDS)
    assert (more.ours, more.by_cpu, more.ratio, more.share, more.reached) == (20.0, 10.0, 2.0, 0.25, True)
    less = cost("x", "s", 5.0, run, opponent=20.0, limit=1.0, goal=9.0, **WORDS)
    assert (less.ours, less.by_cpu, less.ratio, less.share, less.reached) == (10.0, 20.0, 2.0, 0.1, False)


def test_a_row_may_have_neither_opponent_nor_limit():
    row = cost("x", "s", 1.0, Timing(1.0, 1.0), opponent=None, limit=None, goal=1.0, **WORDS)
    assert row.ratio is None and row.share is None and row.reached


def test_operations_are_counted():
    a, b = torch.rand(3, 4), torch.rand(4, 5)
    assert operations(lambda: a @ b) == 2 * 3 * 4 * 5
    assert operations(lambda: (a + a).sin()) == 24
    assert operations(lambda: a.T.clone()) == 0


def test_the_table_shows_every_row(capsys):
    also = {"another": "skipped: not installed", "a third": 5.0}
    row = rate("regressor", "states/s", 6e5, Timing(2.0, 2.0), 1e5, None, 1e6, also=also, **WORDS)
    run.show([row], quick=False)
    shown = capsys.readouterr().out
    assert "300,000" in shown and "3×" in shown and "skipped" in shown and "a third" in shown


@pytest.mark.parametrize("arguments", [["--only", "nothing"], ["--repeats", "0"], ["--seeds", "0"]])
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
