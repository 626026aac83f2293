"""An artifact: a result on disk that says what it is made with, from what, by whom.

Folders, the order of work, reuse and what MLflow records follow from it.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import yaml

from sidegan.base.names import folder_name
from sidegan.base.parallel import Report
from sidegan.errors import ArtifactError
from sidegan.pipeline.places import VERSIONS

_STAGES = {"baseline": "random", "sums": "replication"}  # of makers that have another name than their stage
Metrics = Mapping[str, float | Sequence[float | None]]


@dataclass
class Build:
    """Folders of an artifact that is being made."""

    folder: Path  # of its files; it is invisible until all of them are there
    work: Path  # of files of unfinished tasks (``write_task``); it survives a kill
    report: Report  # shows how far the work is
    # of the work (seconds and the like); they are kept beside the artifact and not in it
    costs: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True, kw_only=True)
class Artifact:
    """A result on disk; two artifacts with the same digest are interchangeable."""

    maker: str  # who makes it: a key of ``params.yaml`` and the folder that it lies in
    label: str  # what tells it from its siblings, as the name of a folder
    title: str  # for people, and the prefix of its metrics
    settings: Mapping[str, Any]  # what it depends on, plain values as they were set
    inputs: Mapping[str, "Artifact | str"]  # what it is made from; or digests of what was read
    seed: int | None  # of the run; None where nothing is drawn
    make: Callable[[Build], None] = field(repr=False, compare=False)  # fills its folder
    # what is recorded of a finished one, given its folder: numbers, or series of them
    metrics: Callable[[Path], Metrics] = field(repr=False, compare=False)
    alone: bool = False  # its work is spread over all workers already: it is not made beside others

    @property
    def folder(self) -> Path:
        """Its folder below the outputs: its maker, then its label with the first digits of its digest."""
        return Path(folder_name(self.maker), f"{folder_name(self.label)}-{self.digest[:8]}")

    @cached_property
    def params(self) -> dict[str, Any]:
        """Its parameters with the digests of its inputs, as JSON gives them back."""
        params = {
            "maker": self.maker,
            "version": version(self.maker),
            "label": self.label,
            "settings": self.settings,
            "inputs": {k: one if isinstance(one, str) else one.digest for k, one in self.inputs.items()},
            "seed": self.seed,
        }
        return json.loads(json.dumps(params))

    @cached_property
    def digest(self) -> str:
        """Hexadecimal SHA-256 over its parameters."""
        return hashlib.sha256(json.dumps(self.params, sort_keys=True).encode()).hexdigest()

    @property
    def parents(self) -> set[str]:
        """Digests of the artifacts that it is made from."""
        return {source.digest for source in self.inputs.values() if isinstance(source, Artifact)}


def difference(params: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Dotted keys in which other parameters differ, with both values, in words."""
    ours, theirs = flatten(params), flatten(other)
    keys = [key for key in {**ours, **theirs} if ours.get(key) != theirs.get(key)]
    return [f"{key} is {_brief(theirs.get(key))}, not {_brief(ours.get(key))}" for key in keys]


@cache
def versions() -> dict[str, int]:
    """Version of every maker."""
    return yaml.safe_load(VERSIONS.read_text(encoding="utf-8"))


def version(maker: str) -> int:
    """Version of a maker; an ArtifactError where ``params.yaml`` has none."""
    if maker not in versions():
        raise ArtifactError(f"{VERSIONS.name} has no version of {maker!r}")
    return versions()[maker]


def stage_of(maker: str) -> str:
    """Name of the stage in which a maker is."""
    return _STAGES.get(maker, maker.rpartition("_")[2])  # paper_seeds: of stage seeds


def flatten(value: Any, path: str = "") -> dict[str, Any]:
    """Nested mappings as one, with dotted keys."""
    if not isinstance(value, Mapping) or not value:
        return {path: value}
    flat: dict[str, Any] = {}
    for key, x in value.items():
        flat |= flatten(x, f"{path}.{key}" if path else key)
    return flat


def _brief(value: Any) -> str:
    text = "not set" if value is None else str(value)
    return f"{text[:8]}…" if len(text) == 64 else text
