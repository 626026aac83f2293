"""Progress of long loops: a bar with a rate on a terminal, now and then a log line elsewhere."""

import logging
import sys
import time
from collections.abc import Iterable, Iterator, Sized
from contextlib import contextmanager
from typing import TYPE_CHECKING, TextIO, TypeVar

if TYPE_CHECKING:
    from rich.progress import Progress

T = TypeVar("T")

log = logging.getLogger(__name__)

_INTERVAL = 15.0  # [s] between two log lines of one loop

_display: "Progress | None" = None  # shared, since a terminal has room for one live display


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
    """Progress of one loop; call it with (done, total) or tell it how far it came."""

    def __init__(self, description: str, total: int | None) -> None:
        self.description, self.total = description, total
        self.done = 0
        self.note = ""
        self._told = 0  # done at the last log line
        self._began = self._logged = time.monotonic()
        self._task = (
            None if _display is None else _display.add_task(description, total=total, rate="", note="")
        )

    def __call__(self, done: int, total: int | None = None) -> None:
        """So many are done, of so many."""
        self.done, self.total = done, total if total is not None else self.total
        self._show()

    def advance(self, count: int = 1, note: str = "") -> None:
        """So many more are done; ``note`` stays until the next one."""
        self.done += count
        self.note = note or self.note
        self._show()

    def close(self) -> None:
        """The loop is over."""
        if _display is not None and self._task is not None:
            _display.remove_task(self._task)
        elif self._told not in (0, self.done):  # a loop too short for its first line gets no last one
            self._log()

    def describe(self) -> str:
        """How far the loop is, how fast, and how long it may still take."""
        seconds = time.monotonic() - self._began
        rate = self.done / seconds if seconds > 0 else 0.0
        parts = [
            f"{self.description}: {self.done}" + (f" of {self.total}" if self.total else ""),
            speed(rate),
        ]
        if self.total and rate:
            parts.append(f"{duration((self.total - self.done) / rate)} left")
        return ", ".join([*filter(None, parts), *filter(None, [self.note])])

    def _show(self) -> None:
        now = time.monotonic()
        if _display is not None and self._task is not None:
            rate = speed(self.done / max(now - self._began, 1e-9))
            _display.update(self._task, completed=self.done, total=self.total, rate=rate, note=self.note)
        elif now - self._logged >= _INTERVAL:
            self._log()

    def _log(self) -> None:
        self._logged, self._told = time.monotonic(), self.done
        log.info("%s", self.describe())


@contextmanager
def bar(description: str, total: int | None = None) -> Iterator[Bar]:
    """A bar for the block; see ``Bar``."""
    with _shown():
        one = Bar(description, total)
        try:
            yield one
        finally:
            one.close()


def track(items: Iterable[T], description: str, total: int | None = None) -> Iterator[T]:
    """The items, with a bar beside them.

    Args:
        items: what to loop over.
        description: what the loop does.
        total: number of items; their length when they have one.
    """
    if total is None:
        total = len(items) if isinstance(items, Sized) else None
    with bar(description, total) as one:
        for item in items:
            yield item
            one.advance()


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


@contextmanager
def _shown() -> Iterator[None]:
    global _display
    if _display is not None or not sys.stderr.isatty():
        yield
        return
    from rich.console import Console
    from rich.progress import BarColumn, MofNCompleteColumn, Progress, TextColumn, TimeRemainingColumn

    columns = (
        TextColumn("{task.description}"),
        BarColumn(),
        MofNCompleteColumn(),
        TextColumn("{task.fields[rate]}"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[note]}"),
    )
    with Progress(*columns, console=Console(stderr=True), transient=True) as _display:
        try:
            yield
        finally:
            _display = None
