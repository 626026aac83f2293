"""The soak: a leak is seen, flat memory is not called one, and the work is real."""

import math
import time

import pytest
import torch

from benchmarks import soak
from benchmarks.setting import Setting
from benchmarks.soak import Sample, Slope, slope_of
from benchmarks.soak_work import Work


def samples(memory, seconds=5.0):
    return [Sample(seconds * k, mb, k, 1000, 6, 2) for k, mb in enumerate(memory)]


def test_the_slope_of_a_straight_line_is_exact():
    found = slope_of(samples([500 + 0.1 * k for k in range(200)]))
    assert found.value == pytest.approx(0.1 / 5 * 3600) and found.margin < 1e-6 and found.grows


def test_what_is_loaded_at_the_beginning_is_no_growth():
    found = slope_of(samples([300.0 + 20 * k for k in range(40)] + [1100.0] * 160))
    assert found.value == pytest.approx(0.0, abs=1e-9) and not found.grows


def test_memory_that_goes_up_and_down_does_not_grow():
    noise = torch.randn(400, generator=torch.Generator().manual_seed(0)).cumsum(0)
    wandering = noise - noise[-1] * torch.linspace(0, 1, 400)
    assert not slope_of(samples([700 + x for x in wandering.tolist()])).grows


@pytest.mark.parametrize(
    ("value", "margin", "grows"), [(100.0, 99.0, False), (100.0, 20.0, True), (4.0, 0.1, False)]
)
def test_growth_is_told_when_it_is_sure_and_matters(value, margin, grows):
    assert Slope(value, margin).grows is grows


def test_too_few_samples_tell_nothing():
    assert math.isinf(slope_of(samples([1.0, 2.0])).margin)


def test_a_leak_is_found_in_this_process(monkeypatch):
    monkeypatch.setattr(soak.gc, "collect", lambda: 0)  # takes its time beside a whole test suite's objects
    leaked = []

    def leaking(number):
        leaked.append(torch.ones(10 * 2**20))  # 40 MB: so much never comes from what was freed before
        time.sleep(0.1)

    found = soak.soak(leaking, 3.0, every=0.0)
    assert found[-1].rounds == len(leaked)
    assert slope_of(found).grows


def test_a_round_is_the_librarys_work(tmp_path):
    Work(Setting(), tmp_path).round(0)
    assert sorted(path.name for path in tmp_path.iterdir()) == ["generator.pt", "library.parquet"]


def test_the_command_leaves_a_table_and_a_picture(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(soak, "_EVERY", 0.0)
    monkeypatch.setattr(Work, "round", lambda work, number: None)
    assert soak.main(["--minutes", "0.01", "--folder", str(tmp_path)]) == 0
    assert "does not grow" in capsys.readouterr().out
    assert (tmp_path / "soak.png").read_bytes().startswith(b"\x89PNG")
    known = soak.read(tmp_path / "soak.csv")
    assert known[0].rounds == 0 and known[-1].seconds >= 0.6 and isinstance(known[-1].files, int)
