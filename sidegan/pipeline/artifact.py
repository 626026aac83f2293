"""An artifact: a result on disk with its settings, inputs and maker.

They determine its folder, the order of work, reuse, and what MLflow records.
"""

import hashlib
import json
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache, cached_property
from pathlib import Path
from typing import Any

import yaml

from sidegan.base.conf import VERSIONS
from sidegan.base.names import dotted, folder_name
from sidegan.base.parallel import Report
from sidegan.errors import ArtifactError

# stages of makers that have another name
_STAGES = {"baseline": "random", "short": "long", "sums": "replication"}
_ALSO = {"gan": ["surrogates", "subsets"], "surrogates": ["subsets"]}  # other stages that make some
Metrics = Mapping[str, float | Sequence[float | None]]


@dataclass
class Build:
    """Folders of an artifact that is being made."""

    folder: Path  # for its files; renamed into place when complete
    work: Path  # for files of unfinished tasks (written without making it); survives a kill
    report: Report  # to call with the steps that are done, and all of them
    costs: dict[str, Any] = field(default_factory=dict)  # seconds and the like; stored outside the artifact


@dataclass(frozen=True, kw_only=True)
class Artifact:
    """A result on disk; two artifacts with the same digest are interchangeable."""

    maker: str  # key of ``params.yaml``, and its parent folder
    label: str  # distinguishes it from its siblings; a folder name
    title: str  # shown to users, and the prefix of its metrics
    settings: Mapping[str, Any]  # that it depends on, plain values as they were set
    inputs: Mapping[str, "Artifact | str"]  # artifacts, or digests of files, that it is made from
    seed: int | None  # of the run; None if nothing is random
    make: Callable[[Build], None] = field(repr=False, compare=False)  # fills its folder
    # numbers, or series of numbers, to record from its finished folder
    metrics: Callable[[Path], Metrics] = field(repr=False, compare=False)
    alone: bool = False  # not made beside others, since it uses all workers itself or is timed

    @property
    def folder(self) -> Path:
        """Folder below the outputs: maker / label with the first digits of the digest."""
        return Path(self.maker, f"{folder_name(self.label)}-{self.digest[:8]}")

    @cached_property
    def params(self) -> dict[str, Any]:
        """Parameters with the digests of the inputs, as read back from JSON."""
        if self.maker not in versions():
            raise ArtifactError(f"{VERSIONS.name} has no version of {self.maker!r}")
        params = {
            "maker": self.maker,
            "version": versions()[self.maker],
            "label": self.label,
            "settings": self.settings,
            "inputs": {k: x if isinstance(x, str) else x.digest for k, x in self.inputs.items()},
            "seed": self.seed,
        }
        return json.loads(json.dumps(params))

    @cached_property
    def digest(self) -> str:
        """Hexadecimal SHA-256 of the parameters."""
        return hashlib.sha256(json.dumps(self.params, sort_keys=True).encode()).hexdigest()


def difference(params: Mapping[str, Any], other: Mapping[str, Any]) -> list[str]:
    """Text for each dotted key in which parameters differ, with both values."""
    a, b = dotted(params), dotted(other)
    keys = [key for key in {**a, **b} if a.get(key) != b.get(key)]
    return [f"{key} is {_brief(b.get(key))}, not {_brief(a.get(key))}" for key in keys]


@cache
def versions() -> dict[str, int]:
    """Version of every maker."""
    return yaml.safe_load(VERSIONS.read_text(encoding="utf-8"))


def stage_of(maker: str) -> str:
    """Name of the stage that a maker belongs to."""
    return _STAGES.get(maker, maker.rpartition("_")[2])  # paper_seeds belongs to seeds


def stages_of(maker: str) -> list[str]:
    """Stages of which at least one makes any artifact of this maker, the usual one first."""
    return [stage_of(maker), *_ALSO.get(maker, [])]


def _brief(value: Any) -> str:
    text = "not set" if value is None else str(value)
    return f"{text[:8]}…" if len(text) == 64 else text
