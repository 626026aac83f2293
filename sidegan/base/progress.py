"""Progress of long loops: a live bar with a rate on a terminal, now and then a log line elsewhere."""

import logging
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO

if TYPE_CHECKING:
    from rich.progress import Progress

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


class Bar:
    """Progress of one loop of ``total`` steps; call it with the number that are done."""

    def __init__(self, description: str, total: int, display: "Progress | None" = None) -> None:
        self.description, self.total, self.done, self._display = description, total, 0, display
        self._written: int | None = None  # done at the last log line
        self._began = self._logged = time.monotonic()
        if display is not None:
            self._task = display.add_task(description, total=total, rate="")

    def __call__(self, done: int) -> None:
        """So many are done."""
        self.done = done
        if self._display is not None:
            self._display.update(self._task, completed=done, rate=speed(self._rate()))
        elif time.monotonic() - self._logged >= _INTERVAL:
            self._log()

    def close(self) -> None:
        """The loop is over; one that was too short for its first line gets no last one."""
        if self._written not in (None, self.done):
            self._log()

    def _rate(self) -> float:
        return self.done / max(time.monotonic() - self._began, 1e-9)

    def _log(self) -> None:
        """How far the loop is, how fast, and how long it may still take."""
        self._logged, self._written, rate = time.monotonic(), self.done, self._rate()
        left = f"{duration((self.total - self.done) / rate)} left" if rate else ""
        words = (f"{self.description}: {self.done} of {self.total}", speed(rate), left)
        log.info("%s", ", ".join(filter(None, words)))


@contextmanager
def bar(description: str, total: int) -> Iterator[Bar]:
    """A bar for the block; see ``Bar``."""
    if not sys.stderr.isatty():
        one = Bar(description, total)
        try:
            yield one
        finally:
            one.close()
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    rate = TextColumn("{task.fields[rate]}")
    columns = TextColumn("{task.description}"), BarColumn(), MofNCompleteColumn(), rate, TimeRemainingColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        yield Bar(description, total, display)


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
