"""Names from settings and files as names of files, listed and counted for people; and numbers for people."""

import hashlib
import re
from collections.abc import Sequence

_LONGEST = 100  # bytes; file systems take 255
_DIGEST = 8  # characters of the digest that stands for what was cut off
_LARGE = 1e6  # from which on a number has an exponent


def folder_name(text: str, longest: int = _LONGEST) -> str:
    """A text as one name of a file or folder: no separators, not hidden, and cut to a length [bytes].

    What was cut off is told by a digest. A name that is fine stays as it is.
    """
    name = re.sub(r"[^\w.,=+-]+", "_", text).strip("_.") or "_"
    if len(name.encode()) <= longest:
        return name
    digest = hashlib.sha256(text.encode()).hexdigest()[:_DIGEST]
    return f"{name.encode()[: longest - _DIGEST - 1].decode(errors='ignore')}-{digest}"


def listed(names: Sequence[str], most: int = 8) -> str:
    """The first of some names, and how many there are beside them."""
    more = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + more


def counted(count: int, noun: str, several: str = "") -> str:
    """How many there are of something, in words: 1 gap, 2 gaps; ``several`` is an irregular plural."""
    return f"{count} {noun if count == 1 else several or noun + 's'}"


def plain(value: float, form: str = ".3g") -> str:
    """A number in a format whose exponents are short, and there only below 1e-4 and from a million on."""
    text = format(value, form)
    if "e+" in text and abs(float(text)) < _LARGE:
        return f"{float(text):.0f}"
    return re.sub(r"e\+?(-?)0*", r"e\1", text)
