"""Progress of long loops: a live bar on a terminal, otherwise occasional log lines."""

import logging
import sys
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from typing import TextIO

log = logging.getLogger(__name__)

_INTERVAL = 15.0  # [s] between log lines of a loop


class ConsoleHandler(logging.StreamHandler[TextIO]):
    """Log handler that writes to the current standard error, which a live bar redirects."""

    def __init__(self) -> None:
        logging.Handler.__init__(self)

    @property
    def stream(self) -> TextIO:  # type: ignore[override]
        """The current standard error."""
        return sys.stderr


@contextmanager
def bar(description: str, total: int) -> Iterator[Callable[[int], None]]:
    """Callback to report the number of completed steps."""
    if not sys.stderr.isatty():
        yield _lines(description, total)
        return
    from rich.console import Console
    from rich.progress import MofNCompleteColumn, Progress

    columns = *Progress.get_default_columns(), MofNCompleteColumn()
    with Progress(*columns, console=Console(stderr=True), transient=True) as display:
        task = display.add_task(description, total=total)
        yield lambda done: display.update(task, completed=done)


def _lines(description: str, total: int) -> Callable[[int], None]:
    """Callback that logs progress and the estimated time left."""
    began = logged = time.monotonic()

    def show(done: int) -> None:
        nonlocal logged
        now = time.monotonic()
        if now - logged >= _INTERVAL and done:
            logged = now
            left = duration((total - done) * (now - began) / done)
            log.info("%s: %d of %d, %s left", description, done, total, left)

    return show


def duration(seconds: float) -> str:
    """A duration in words, e.g. ``3 min 20 s``."""
    if round(seconds) < 60:
        return f"{seconds:.1f} s" if round(seconds, 1) < 10 else f"{seconds:.0f} s"
    minutes, rest = divmod(round(seconds), 60)
    return f"{minutes} min {rest} s" if minutes < 60 else f"{minutes // 60} h {minutes % 60} min"
