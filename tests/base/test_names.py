"""Numbers and progress for people."""

import io
import logging
import math
import sys

import pytest

from sidegan.base import progress
from sidegan.base.names import plain
from sidegan.base.progress import ConsoleHandler, bar, duration
from tests.waiting import wait_until

DURATIONS = ("0.0 s", "10 s", "1 min 0 s", "3 min 20 s", "14 h 0 min")
WORDS = [
    (plain(131.6, ".2g"), "130"),
    (plain(-99950.0, ".3g"), "-100000"),
    (plain(999_600.0, ".3g"), "1e6"),
    (plain(3.6e-7, ".2g"), "3.6e-7"),
    (plain(0.00047, ".3g"), "0.00047"),
    (plain(0.123, ".0%"), "12%"),
    (plain(1234.5, ",.0f"), "1,234"),
    (plain(math.nan, ".3g"), "nan"),
    *zip(map(duration, (0.04, 9.97, 59.7, 200, 50_400)), DURATIONS),
]


@pytest.mark.parametrize(("found", "words"), WORDS)
def test_numbers_and_durations_in_words(found, words):
    assert found == words


class Terminal(io.StringIO):
    def isatty(self):
        return True


LINES = ["15 of 40, 25 s", "30 of 40, 10 s"]


@pytest.mark.parametrize(("seconds", "lines"), [(0.1, []), (1.0, LINES)])
def test_without_a_terminal_progress_is_logged_occasionally(caplog, monkeypatch, seconds, lines):
    caplog.set_level(logging.INFO)
    now = [0.0]
    monkeypatch.setattr(progress.time, "monotonic", lambda: now[0])
    with bar("long", 40) as advance:
        for done in range(41):
            now[0] = seconds * done
            advance(done)
    assert [record.message for record in caplog.records] == [f"long: {line} left" for line in lines]


def test_on_a_terminal_progress_is_a_live_bar(monkeypatch, caplog):
    terminal = Terminal()
    monkeypatch.setattr(sys, "stderr", terminal)
    with bar("outer", 2) as advance:
        advance(1)
        wait_until(lambda: all(word in terminal.getvalue() for word in ("outer", "1/2")))  # a thread draws
    assert sys.stderr is terminal and caplog.text == ""


def test_log_lines_go_to_the_current_standard_error(monkeypatch):
    handler, later = ConsoleHandler(), io.StringIO()
    monkeypatch.setattr(sys, "stderr", later)
    handler.emit(logging.makeLogRecord({"msg": "a line"}))
    assert later.getvalue() == "a line\n"
