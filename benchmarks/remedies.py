"""Following what refusals say, as a user would: the words on the command line that they print."""

import re
from collections.abc import Callable, Iterable
from typing import TypeVar

from sidegan.errors import SideganError

T = TypeVar("T")

ROUNDS = 6  # of following remedies
_SETTING = r"(?:robot|workspace)(?:\.[a-z_]+)*="
_REMEDY = re.compile(rf"'({_SETTING}[^']*)'|({_SETTING}[^\s;,]+)")


def followed(message: str, words: dict[str, str]) -> dict[str, str]:
    """Settings with what a refusal offers: of several that exclude each other the first."""
    more = dict(words)
    for quoted, plain in _REMEDY.findall(message):
        name, _, value = (quoted or plain).partition("=")
        if name == "robot.tip" and name in more:
            continue
        more[name] = value
        if name == "robot.tip":
            break
    return more


def remedied(work: Callable[[list[str]], T], given: Iterable[str] = ()) -> tuple[T, list[str]]:
    """The outcome of some work on words of the command line, and the words that it took beside those given.

    Raises:
        SideganError: what is refused though its remedies, if any, were followed.
    """
    words = {name: value for name, _, value in (word.partition("=") for word in given)}
    for _ in range(ROUNDS):
        said = [f"{name}={value}" for name, value in words.items()]
        try:
            return work(said), said
        except SideganError as error:
            more = followed(str(error), words)
            if more == words:
                raise
            words = more
    raise SideganError(f"refused {ROUNDS} times, at last with {words}")
