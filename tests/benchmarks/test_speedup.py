import json
import time
from functools import partial

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from benchmarks import speedup
from benchmarks.speedup import Overhead, main, predict

FREE = Overhead(0.0, 0.0, 0.0, 0.0)
durations = st.lists(st.floats(0.01, 10.0), min_size=1, max_size=30)


@given(durations, st.integers(2, 8))
@settings(max_examples=50, deadline=None)
def test_without_overhead_the_model_keeps_grahams_bounds(seconds, workers):
    wall = predict(seconds, workers, FREE)
    least = max(max(seconds), sum(seconds) / workers)
    assert least - 1e-9 <= wall <= sum(seconds) / workers + max(seconds) + 1e-9


@given(durations)
def test_one_worker_takes_the_sum_and_opens_nothing(seconds):
    assert predict(seconds, 1, Overhead(1.0, 2.0, 3.0, 4.0)) == sum(seconds)


def test_handing_out_is_what_limits_many_workers():
    costs = Overhead(5.0, 0.5, 0.01, 0.002)
    assert predict([0.1] * 1000, 1000, costs) == pytest.approx(0.5 + 1000 * 0.01 + 0.002 + 0.1)


def task(seed):
    time.sleep(0.02)
    return torch.full((3,), float(seed))


def test_the_command_compares_and_tells(tmp_path, monkeypatch, capsys):
    works = {"naps": ([partial(task, seed) for seed in range(4)], 100)}
    monkeypatch.setattr(speedup, "works", lambda setting: works)
    monkeypatch.setattr(speedup, "_EMPTY", 10)
    assert main(["--quick", "--json", str(tmp_path / "found.json")]) == 0
    assert "| naps | 4 | " in capsys.readouterr().out
    (row,) = json.loads((tmp_path / "found.json").read_text())["rows"]
    assert row["same"] and row["measured"]["1"] >= 0.08
    assert 0 < row["many"]["8"] <= row["many"]["64"] <= 64
    with pytest.raises(SystemExit):
        main(["--workers", "1"])
