import io
import logging
import sys
import time

import pytest

from sidegan.base import progress
from sidegan.base.progress import ConsoleHandler, bar, duration, speed


class Terminal(io.StringIO):
    def isatty(self):
        return True


@pytest.fixture
def clock(monkeypatch):
    """A clock that the test turns."""
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    return now


def test_nothing_is_said_about_a_short_loop(capsys, caplog, clock):
    caplog.set_level(logging.INFO)
    with bar("short", 3) as one:
        for done in (1, 2, 3):
            one(done)
    captured = capsys.readouterr()
    assert captured.out == captured.err == caplog.text == ""


def test_without_a_terminal_a_long_loop_logs_now_and_then(caplog, clock):
    caplog.set_level(logging.INFO)
    with bar("long", 40) as one:
        for done in range(1, 41):
            clock[0] += 1.0
            one(done)
    assert [record.message for record in caplog.records] == [
        "long: 15 of 40, 1/s, 25 s left",
        "long: 30 of 40, 1/s, 10 s left",
        "long: 40 of 40, 1/s, 0.0 s left",
    ]


def test_a_loop_that_has_done_nothing_yet_has_no_rate_and_no_time_left(caplog, clock):
    caplog.set_level(logging.INFO)
    with bar("seeds", 10) as one:
        clock[0] = 20.0
        one(0)
        clock[0] = 40.0
        one(4)
    assert [record.message for record in caplog.records] == [
        "seeds: 0 of 10",
        "seeds: 4 of 10, 6/min, 1 min 0 s left",
    ]


def test_on_a_terminal_bars_are_live_may_nest_and_go_away(monkeypatch, caplog):
    caplog.set_level(logging.INFO)
    terminal, words = Terminal(), ("outer", "inner", "1/2", "2/3")
    monkeypatch.setattr(sys, "stderr", terminal)
    with bar("outer", 2) as outer, bar("inner", 3) as inner:
        outer(1)
        inner(2)
        end = time.monotonic() + 60  # a thread of its own draws ten times a second, when it has its turn
        while not (drawn := all(word in terminal.getvalue() for word in words)) and time.monotonic() < end:
            time.sleep(0.05)
    assert drawn
    assert sys.stderr is terminal
    assert caplog.text == ""


def test_a_bar_ends_with_its_block_even_when_that_fails(monkeypatch):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with pytest.raises(KeyboardInterrupt), bar("stopped", 2):
        raise KeyboardInterrupt
    assert sys.stderr is terminal


def test_log_lines_go_to_standard_error_as_it_is_now(monkeypatch):
    handler = ConsoleHandler()
    later = io.StringIO()
    monkeypatch.setattr(sys, "stderr", later)
    handler.emit(logging.makeLogRecord({"msg": "a line"}))
    assert later.getvalue() == "a line\n"


@pytest.mark.parametrize(
    ("seconds", "words"), [(0.04, "0.0 s"), (12.4, "12 s"), (200, "3 min 20 s"), (50_400, "14 h 0 min")]
)
def test_durations_in_words(seconds, words):
    assert duration(seconds) == words


@pytest.mark.parametrize(("rate", "words"), [(0, ""), (0.2, "12/min"), (31, "31/s"), (310_000, "310,000/s")])
def test_rates_in_words(rate, words):
    assert speed(rate) == words
