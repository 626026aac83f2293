import json
import math

import pytest

from benchmarks import run
from benchmarks.timing import cost_row, rate_row


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    path = tmp_path_factory.mktemp("benchmarks") / "result.json"
    assert run.main(["--quick", "--repeats", "1", "--json", str(path)]) == 0
    return json.loads(path.read_text(encoding="utf-8"))


def test_every_row_is_there_and_positive(result):
    assert [row["name"] for row in result["rows"]] == list(run.BENCHMARKS)
    for row in result["rows"]:
        for key in ("ours", "opponent", "ratio"):
            assert math.isfinite(row[key]) and row[key] > 0, row
        assert row["limit"] is None
        assert row["unit"]


def test_the_machine_is_named(result):
    assert result["quick"] is True
    assert result["machine"]["cpu"] and result["machine"]["cores"] >= 1
    assert result["machine"]["torch"] and result["machine"]["python"]


def test_a_ratio_above_one_is_better_in_both_directions():
    assert rate_row("x", "1/s", 20.0, 10.0, "y").ratio == 2
    assert cost_row("x", "s", 10.0, 20.0, "y").ratio == 2


def test_the_table_shows_every_row(capsys):
    run.show([rate_row("regressor", "states/s", 300_000.0, 100_000.0, "Pinocchio")], quick=False)
    shown = capsys.readouterr().out
    assert "300,000" in shown and "3×" in shown


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
