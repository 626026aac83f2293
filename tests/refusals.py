"""What is refused: tests compare the kind of an error and the names that it is about, not its sentences.

``pytest --messages=FILE`` writes the sentences, of the tests that ran, into one file for a person to read.
"""

from collections.abc import Iterator
from contextlib import contextmanager

import pytest

from sidegan.errors import SideganError

_said: list[str] = []


@contextmanager
def refused(kind: type[SideganError], *about: str) -> Iterator[pytest.ExceptionInfo[SideganError]]:
    """The block has to raise an error of this kind, that names these joints, settings or files."""
    with pytest.raises(kind) as caught:
        yield caught
    message = str(caught.value)
    _said.append(f"{kind.__name__}: {message}")
    assert not [name for name in about if name not in message], message


def said() -> list[str]:
    """The messages so far, once each."""
    return sorted(set(_said))
