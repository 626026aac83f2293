"""The soak: a leak is seen, flat memory is not called one, and the work is real."""

import math
import time

import pandas as pd
import pytest
import torch

from benchmarks import soak
from benchmarks.soak import grows, slope_of


def samples(memory, seconds=5.0):
    return pd.DataFrame({"seconds": [seconds * k for k in range(len(memory))], "resident_mb": memory})


def test_the_slope_of_a_straight_line_is_exact():
    slope, margin = slope_of(samples([500 + 0.1 * k for k in range(200)]))
    assert slope == pytest.approx(0.1 / 5 * 3600) and margin < 1e-6 and grows(slope, margin)


def test_what_is_loaded_at_the_beginning_is_no_growth():
    slope, margin = slope_of(samples([300.0 + 20 * k for k in range(40)] + [1100.0] * 160))
    assert slope == pytest.approx(0.0, abs=1e-9) and not grows(slope, margin)


def test_memory_that_goes_up_and_down_does_not_grow():
    noise = torch.randn(400, generator=torch.Generator().manual_seed(0)).cumsum(0)
    wandering = noise - noise[-1] * torch.linspace(0, 1, 400)
    assert not grows(*slope_of(samples([700 + x for x in wandering.tolist()])))


@pytest.mark.parametrize(
    ("slope", "margin", "growing"), [(100.0, 99.0, False), (100.0, 20.0, True), (4.0, 0.1, False)]
)
def test_growth_is_told_when_it_is_sure_and_matters(slope, margin, growing):
    assert grows(slope, margin) is growing


def test_too_few_samples_tell_nothing():
    assert math.isinf(slope_of(samples([1.0, 2.0]))[1])


def test_a_leak_is_found_in_this_process(monkeypatch):
    monkeypatch.setattr(soak.gc, "collect", lambda: 0)  # takes its time beside a whole test suite's objects
    leaked = []

    def leaking():
        leaked.append(torch.ones(10 * 2**20))  # 40 MB: so much never comes from what was freed before
        time.sleep(0.1)

    result = soak.soak(leaking, 3.0, every=0.0)
    assert result.rounds.iloc[-1] == len(leaked)
    assert grows(*slope_of(result))


def test_the_command_leaves_a_table_and_a_picture(tmp_path, monkeypatch, capsys):
    monkeypatch.setattr(soak, "_EVERY", 0.0)
    rounds = []
    one_round = soak.one_round

    def once():
        """The real work in the first round."""
        if not rounds:
            one_round()
        rounds.append(len(rounds))

    monkeypatch.setattr(soak, "one_round", once)
    assert soak.main(["--minutes", "0.01", "--folder", str(tmp_path)]) in (0, 1)
    assert "rounds in" in capsys.readouterr().out
    assert (tmp_path / "soak.png").read_bytes().startswith(b"\x89PNG")
    table = pd.read_csv(tmp_path / "soak.csv")
    assert table.rounds.iloc[0] == 0 and table.rounds.iloc[-1] == len(rounds)
    assert table.seconds.iloc[-1] >= 0.6 and soak.outcome(table).count("→") == 4
