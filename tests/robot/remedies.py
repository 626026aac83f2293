"""Following what refusals say, as a user would: the words on the command line that they print."""

import re

from sidegan.errors import SideganError

_ROUNDS = 6
_SETTING = r"(?:robot|workspace)(?:\.[a-z_]+)*="
_REMEDY = re.compile(rf"'({_SETTING}[^']*)'|({_SETTING}[^\s;,]+)")


def remedied(work, given=()):
    """Outcome of ``work(words)``, and the words that it took; of several ends of an arm the first."""
    words = dict(word.split("=", 1) for word in given)
    for _ in range(_ROUNDS):
        said = [f"{name}={value}" for name, value in words.items()]
        try:
            return work(said), said
        except SideganError as error:
            offered = [(a or b).split("=", 1) for a, b in _REMEDY.findall(str(error))]
            tips = [one for one in offered if one[0] == "robot.tip" and "robot.tip" not in words]
            more = words | dict(tips[:1] or [one for one in offered if one[0] != "robot.tip"])
            if more == words:
                raise
            words = more
    raise AssertionError(f"refused {_ROUNDS} times, at last with {words}")
