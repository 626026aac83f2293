"""The benchmark of optimal design: it runs, and says what it should."""

import math

import pytest

from benchmarks import design
from benchmarks.setting import Setting


@pytest.fixture(autouse=True)
def small(monkeypatch):
    monkeypatch.setattr(design, "_LIBRARY", 600)
    monkeypatch.setattr(design, "_PLAIN", 50)


def test_the_row_of_the_benchmark():
    result = design.design(Setting(quick=True))
    assert all(math.isfinite(x) and x > 0 for x in (result.run.wall, result.opponent))
    assert {"A-optimal", "exchange after it", "the paper's score"} <= set(result.also)


def test_the_table_shows_every_method(capsys):
    assert design.main(["--quick"]) == 0
    shown = capsys.readouterr().out
    for word in ("D-optimal", "A-optimal", "exchange after it", "chance", "condition", "of 60 trajectories"):
        assert word in shown


def test_the_diagonals_are_those_of_excitation():
    from sidegan.design.excitation import excite

    setting = Setting(quick=True)
    _, diagonals = design.library(setting)
    c = setting.start(60)
    expected = excite(setting.problem.body, setting.problem.trajectory, c, design._SAMPLES).diagonal
    assert ((diagonals - expected).abs() <= 1e-9 * expected.max()).all()
