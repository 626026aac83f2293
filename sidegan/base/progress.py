"""Progress of long loops: a live bar with a rate on a terminal, now and then a log line elsewhere."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import closing, contextmanager
from typing import TextIO

log = logging.getLogger(__name__)

_INTERVAL = 15.0  # [s] between two log lines of one loop


class ConsoleHandler(logging.StreamHandler[TextIO]):
    """Log handler for the terminal that keeps out of the way of a live bar.

    It looks standard error up at every line, because a live bar puts itself in between.
    """

    def __init__(self) -> None:
        logging.Handler.__init__(self)

    @property
    def stream(self) -> TextIO:  # type: ignore[override]
        """Standard error as it is now."""
        return sys.stderr


class Lines:
    """Log lines about a loop of ``total`` steps; call it with the number that are done."""

    def __init__(self, description: str, total: int) -> None:
        self.description, self.total, self.done = description, total, 0
        self._written: int | None = None  # done at the last log line
        self._began = self._logged = time.monotonic()

    def __call__(self, done: int) -> None:
        """So many are done."""
        self.done = done
        if time.monotonic() - self._logged >= _INTERVAL:
            self._log()

    def close(self) -> None:
        """The loop is over; one that was too short for its first line gets no last one."""
        if self._written not in (None, self.done):
            self._log()

    def _log(self) -> None:
        """How far the loop is, how fast, and how long it may still take."""
        self._logged, self._written = time.monotonic(), self.done
        rate = self.done / max(self._logged - self._began, 1e-9)
        left = f"{duration((self.total - self.done) / rate)} left" if rate else ""
        words = (f"{self.description}: {self.done} of {self.total}", speed(rate), left)
        log.info("%s", ", ".join(filter(None, words)))


@contextmanager
def bar(description: str, total: int) -> Iterator[Callable[[int], None]]:
    """What to tell how many steps of the block's loop are done: a bar on a terminal, else log lines."""
    if not sys.stderr.isatty():
        with closing(Lines(description, total)) as lines:
            yield lines
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    rate = TextColumn("{task.fields[rate]}")
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), rate, TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        task, began = display.add_task(description, total=total, rate=""), time.monotonic()
        yield lambda done: display.update(
            task, completed=done, rate=speed(done / max(time.monotonic() - began, 1e-9))
        )


def duration(seconds: float) -> str:
    """A duration in words, e.g. ``3 min 20 s``."""
    if seconds < 60:
        return f"{seconds:.1f} s" if seconds < 10 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"


def speed(rate: float) -> str:
    """A rate in words, per second or, when slow, per minute; nothing when there is none yet."""
    if not rate:
        return ""
    if rate < 0.5:
        return f"{60 * rate:.3g}/min"
    return f"{rate:.3g}/s" if rate < 100 else f"{rate:,.0f}/s"
