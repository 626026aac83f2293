"""File names from arbitrary text, and lists, counts and numbers for people."""

import hashlib
import json
import re
from collections.abc import Mapping, Sequence
from typing import Any

_LONGEST = 100  # bytes; file systems take 255
_DIGEST = 8  # characters of the digest that replaces the rest
_LARGE = 1e6  # from which numbers have an exponent


def folder_name(text: str) -> str:
    """Text as the name of a file or folder: without separators, not hidden, at most 100 bytes.

    A digest replaces what does not fit. A name that it returns stays as it is.
    """
    name = re.sub(r"[^\w.,=+-]+", "_", text).strip("_.") or "_"
    if len(name.encode()) <= _LONGEST:
        return name
    digest = hashlib.sha256(text.encode()).hexdigest()[:_DIGEST]
    return f"{name.encode()[: _LONGEST - _DIGEST - 1].decode(errors='ignore')}-{digest}"


def stamp_of(*values: object) -> str:
    """Digest of plain values, as the name of a folder for what is made from them."""
    return hashlib.sha256(json.dumps(values, sort_keys=True).encode()).hexdigest()[: 2 * _DIGEST]


def listed(names: Sequence[str], most: int = 8) -> str:
    """The first ``most`` names, and the number of others."""
    others = f" and {len(names) - most} more" if len(names) > most else ""
    return ", ".join(names[:most]) + others


def counted(count: int, noun: str, several: str = "") -> str:
    """A count with its noun: 1 gap, 2 gaps; ``several`` is an irregular plural."""
    return f"{count} {noun if count == 1 else several or noun + 's'}"


def plain(value: float, form: str = ".3g") -> str:
    """A number in a format with short exponents, only below 1e-4 and from a million on."""
    text = format(value, form)
    if "e+" in text and abs(float(text)) < _LARGE:
        return f"{float(text):.0f}"
    return re.sub(r"e\+?(-?)0*", r"e\1", text)


def dotted(value: Any, path: str = "") -> dict[str, Any]:
    """Nested mappings as a flat one with dotted keys."""
    if not isinstance(value, Mapping) or not value:
        return {path: value}
    flat: dict[str, Any] = {}
    for key, x in value.items():
        flat |= dotted(x, f"{path}.{key}" if path else key)
    return flat
