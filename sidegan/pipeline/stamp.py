"""What an artifact came from, so that it can be told whether it is still valid."""

import dataclasses
import hashlib
import json
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

from sidegan.errors import ArtifactError

_CODE = Path(__file__).parents[1]


@dataclass(frozen=True)
class Stamp:
    """What an artifact came from; two artifacts with the same digest are interchangeable.

    Attributes:
        stage: who makes it.
        label: what tells it from its siblings at a glance, e.g. a GAN variant.
        config: the settings it depends on, plain values.
        inputs: digest of each thing that it is made from.
        code: digest of each room whose code makes it.
        seed: of its random numbers; None when it has none.
    """

    stage: str
    label: str
    config: dict[str, Any]
    inputs: dict[str, str] = field(default_factory=dict)
    code: dict[str, str] = field(default_factory=dict)
    seed: int | None = None

    @cached_property
    def digest(self) -> str:
        """Hexadecimal SHA-256 over all of it."""
        return hashlib.sha256(json.dumps(self.plain(), sort_keys=True).encode()).hexdigest()

    def plain(self) -> dict[str, Any]:
        """The stamp as JSON gives it back."""
        return json.loads(json.dumps(dataclasses.asdict(self)))

    def difference(self, other: Mapping[str, Any]) -> list[str]:
        """Dotted keys in which another stamp's plain values differ, with both values."""
        mine, theirs = flatten(self.plain()), flatten(other)
        keys = [key for key in {**mine, **theirs} if mine.get(key) != theirs.get(key)]
        return [f"{key} is {_brief(theirs.get(key))}, not {_brief(mine.get(key))}" for key in keys]


@cache
def code_digest(room: str) -> str:
    """Digest of a room's source: ``dynamics`` for a file, ``seeds`` for a folder of them.

    Taken once per process, so that an edit in the middle of a run does not split it in two.
    """
    base = _CODE / room.replace(".", "/")
    files = sorted(base.rglob("*.py")) if base.is_dir() else [base.with_suffix(".py")]
    if not files or not files[0].is_file():
        raise ArtifactError(f"there is no room {room!r} in {_CODE}")
    digest = hashlib.sha256()
    for path in files:
        digest.update(path.relative_to(_CODE).as_posix().encode() + b"\0" + path.read_bytes() + b"\0")
    return digest.hexdigest()


def folder_name(text: str, longest: int = 100) -> str:
    """A text as the name of a folder: no separators, and cut to a length, ending in a digest of the rest."""
    name = re.sub(r"[^\w.,=+-]+", "_", text).strip("_.") or "_"
    if len(name) <= longest:
        return name
    return f"{name[: longest - 9]}-{hashlib.sha256(text.encode()).hexdigest()[:8]}"


def flatten(value: Any, path: str = "") -> dict[str, Any]:
    """Nested mappings as one, with dotted keys."""
    if isinstance(value, Mapping) and value:
        return {
            k: v for key, x in value.items() for k, v in flatten(x, f"{path}.{key}" if path else key).items()
        }
    return {path: value}


def _brief(value: Any) -> str:
    text = "not set" if value is None else str(value)
    return f"{text[:8]}…" if len(text) == 64 else text
