"""A bad input, and what sidegan answers to it: in a process of its own, which a crash or no end may cost."""

import faulthandler
import multiprocessing
import resource
import time
import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, NamedTuple

from sidegan.errors import SideganError

SECONDS = 10.0  # in which every case is to be answered
_MEMORY = 8 * 2**30  # bytes beside those of this process
_MANY_LINES = 2


@dataclass(frozen=True)
class Case:
    """Something that is wrong, or only looks so.

    Attributes:
        name: for people.
        act: gives it to sidegan, in an empty folder; raises what a person would be told.
        works: it only looks wrong, and has to work.
    """

    name: str
    act: Callable[[Path], object]
    works: bool = False


class Outcome(NamedTuple):
    """What came of a case: ``answered`` as it should be, in which way, after how long [s], in which words."""

    name: str
    answered: bool
    how: str
    seconds: float
    words: str


def outcomes(cases: Sequence[Case], seconds: float = SECONDS) -> list[Outcome]:
    """What comes of each case; one that has no end is ended after so many seconds."""
    context = multiprocessing.get_context("fork")
    found: list[Outcome] = []
    worker: Any = None
    for number, case in enumerate(cases):
        if worker is None:
            here, there = context.Pipe()
            worker = context.Process(target=_serve, args=(cases, there), daemon=True)
            worker.start()
            there.close()
        began = time.monotonic()
        how, words = "no end", f"nothing after {seconds:g} s"
        try:
            here.send(number)
            if here.poll(seconds):
                how, words = here.recv()
        except (EOFError, ConnectionError):
            how, words = "crash", "the process ended"
        if how in ("no end", "crash"):
            worker.kill()
            worker.join()
            worker = None
        answered = how == ("accepted" if case.works else "refused")
        found.append(Outcome(case.name, answered, how, time.monotonic() - began, words))
    if worker is not None:
        worker.kill()
        worker.join()
    return found


def _serve(cases: Sequence[Case], connection: Any) -> None:
    """Answer numbers of cases until nobody asks."""
    faulthandler.disable()  # of a test runner: a crash is counted, not printed
    used = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * 1024
    resource.setrlimit(resource.RLIMIT_DATA, (used + _MEMORY, used + _MEMORY))
    warnings.simplefilter("ignore")
    while True:
        try:
            number = connection.recv()
        except EOFError:
            return
        with TemporaryDirectory() as folder:
            connection.send(_judged(cases[number], Path(folder)))


def _judged(case: Case, folder: Path) -> tuple[str, str]:
    """How a case was taken, and the words that went with it."""
    try:
        case.act(folder)
    except SideganError as error:
        words = str(error)
        return ("refused" if words and len(words.splitlines()) < _MANY_LINES else "many lines"), words
    except BaseException as error:
        return "traceback", f"{type(error).__name__}: {error}"
    return "accepted", ""
