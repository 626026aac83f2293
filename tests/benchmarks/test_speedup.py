import re
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


def test_the_command_compares_and_prints_a_table(monkeypatch, capsys):
    works = {"seeds": [partial(task, seed) for seed in range(4)]}
    monkeypatch.setattr(speedup, "works", lambda setting: works)
    monkeypatch.setattr(speedup, "_EMPTY", 10)
    assert main(["--quick"]) == 0
    head, _, row = capsys.readouterr().out.splitlines()[2:]
    cells = dict(zip(*(re.split(r" *\| *", line.strip("| ")) for line in (head, row))))
    assert (cells["work"], cells["tasks"], cells["same to the last bit"]) == ("seeds", "4", "yes")
    assert 0 < float(cells["model: 8 workers"]) <= float(cells["model: 64 workers"]) <= 64
    with pytest.raises(SystemExit):
        main(["--workers", "1"])


def test_every_kind_of_work_has_its_number_in_the_paper():
    works = speedup.works(speedup.Setting(quick=True))
    assert works.keys() == speedup.PAPER.keys()
    assert torch.isfinite(works["identification"][0]()).all()
