"""Stored files that cannot be used: libraries, generators and stamps with other numbers, shapes and parts."""

import json
import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import torch

from benchmarks.hostile.case import Case
from sidegan.base.storage import read_json, write_json
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.library import Library
from sidegan.library.foreign import load_foreign
from sidegan.library.measure import measured
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.store import STAMP, read_stamp, write_stamp
from sidegan.robot import load_robot
from sidegan.validity import Constraints

_FAMILY = Trajectory(2, 3, 8.0)
_COLUMNS = ("coefficients", "valid", "fitness", "diagonal_fitness", "spectrum", "diagonal", "source")
_NUMBERS = ("coefficients", "spectrum", "diagonal", "margin_position")


@cache
def _library() -> Library:
    c = 0.3 * torch.randn(30, 2, 3, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    return measured(Constraints(load_robot("planar2")), _FAMILY, c, "made")


@cache
def _generator() -> TrajectoryGenerator:
    arm = load_robot("planar2")
    scaling = Scaling.fit(_library().coefficients)
    return TrajectoryGenerator(Generator(2, 3, width=16), scaling, _FAMILY, arm.name, arm.digest, "made")


def cases() -> Iterator[Case]:
    """All of them."""
    _generator()  # made before the clock runs: kernels may have to be compiled
    for name, change in _libraries():
        yield Case(f"library: {name}", partial(_load_library, change))
    for name, spoil in _GENERATORS.items():
        yield Case(f"generator: {name}", partial(_load_generator, spoil))
    for name, act in _STAMPS.items():
        yield Case(f"stamp: {name}", partial(_load_stamp, act))
    for kind, load in _LOADERS.items():
        for name, make in _ANY.items():
            yield Case(f"{kind}: {name}", partial(_load_any, load, make))


def _load_any(load: Callable[[Path], object], make: Callable[[Path], Path], folder: Path) -> None:
    load(make(folder))


def _load_library(change: Callable[[Path], None], folder: Path) -> None:
    path = folder / "library.parquet"
    _library().save(path)
    change(path)
    load_foreign(path, load_robot("planar2"))


def _libraries() -> Iterator[tuple[str, Callable[[Path], None]]]:
    for column in _COLUMNS:
        yield f"no column {column}", partial(_changed, partial(_dropped, column))
        other = pa.array(range(30)) if column == "source" else pa.array(["x"] * 30)
        yield f"{column} of {other.type}", partial(_changed, partial(_put, column, other))
    for column in _NUMBERS:
        yield f"NaN in {column}", partial(_spoilt, column, np.nan)
    yield "infinite coefficients", partial(_spoilt, "coefficients", np.inf)
    for key, value in (("joints", 3), ("harmonics", 7), ("period", -1.0), ("period", 1e300), ("home", [0.1]),
                       ("home", "x"), ("format", 99), ("margins", ["nothing"]), ("parameters", 1),
                       ("digest", "another"), ("robot", None)):  # fmt: skip
        yield f"{key}={value!r} in the metadata", partial(_described, key, value)
    yield (
        "metadata that are none",
        partial(_changed, lambda table: table.replace_schema_metadata({b"sidegan": b"{"})),
    )
    yield "no metadata", partial(_changed, lambda table: table.replace_schema_metadata({}))
    yield "no rows", partial(_changed, lambda table: table.slice(0, 0))
    for factor in (1000.0, 0.3, -2.0, 0.0):
        yield f"coefficients × {factor:g}", partial(_forged, factor)
    yield "all of them valid", lambda path: replace(_bad(), valid=torch.ones(30, dtype=torch.bool)).save(path)


def _bad() -> Library:
    """A library of which some trajectories are not valid."""
    return measured(Constraints(load_robot("planar2")), _FAMILY, 20 * _library().coefficients, "made")


def _forged(factor: float, path: Path) -> None:
    replace(_library(), coefficients=factor * _library().coefficients).save(path)


def _changed(change: Callable[[Any], Any], path: Path) -> None:
    pq.write_table(change(pq.read_table(path)), path)


def _dropped(column: str, table: Any) -> Any:
    return table.drop([column])


def _put(column: str, values: Any, table: Any) -> Any:
    place, metadata = table.column_names.index(column), table.schema.metadata
    return table.set_column(place, column, values).replace_schema_metadata(metadata)


def _spoilt(column: str, value: float, path: Path) -> None:
    def change(table: Any) -> Any:
        old = table[column].combine_chunks()
        lists = pa.types.is_fixed_size_list(old.type)
        flat = np.array((old.flatten() if lists else old).to_numpy(zero_copy_only=False))
        flat[5] = value
        new = (
            pa.FixedSizeListArray.from_arrays(pa.array(flat), old.type.list_size) if lists else pa.array(flat)
        )
        return _put(column, new, table)

    _changed(change, path)


def _described(key: str, value: Any, path: Path) -> None:
    def change(table: Any) -> Any:
        metadata = {**json.loads(table.schema.metadata[b"sidegan"]), key: value}
        return table.replace_schema_metadata({b"sidegan": json.dumps(metadata).encode()})

    _changed(change, path)


def _load_generator(spoil: Callable[[dict[str, Any]], Any], folder: Path) -> None:
    path = folder / "generator.pt"
    _generator().save(path)
    torch.save(spoil(torch.load(path)), path)
    TrajectoryGenerator.load(path, load_robot("planar2")).sample(3)


def _stated(content: dict[str, Any], group: str | None = None, **changes: Any) -> dict[str, Any]:
    meta = json.loads(content["meta"])
    meta = meta | changes if group is None else meta | {group: meta[group] | changes}
    return {**content, "meta": json.dumps(meta)}


def _weights(content: dict[str, Any], change: Callable[[torch.Tensor], Any]) -> dict[str, Any]:
    return {**content, "weights": {name: change(x) for name, x in content["weights"].items()}}


_GENERATORS: dict[str, Callable[[dict[str, Any]], Any]] = {
    "weights of NaN": lambda c: _weights(c, lambda x: x * torch.nan),
    "infinite weights": lambda c: _weights(c, lambda x: x + torch.inf),
    "weights of another shape": lambda c: _weights(c, lambda x: x[..., :1]),
    "weights that are words": lambda c: _weights(c, lambda x: "x"),
    "no weights": lambda c: {**c, "weights": {}},
    "mean of NaN": lambda c: {**c, "mean": c["mean"] * torch.nan},
    "spread of NaN": lambda c: {**c, "spread": c["spread"] * torch.nan},
    "no spread": lambda c: {**c, "spread": 0 * c["spread"]},
    "spread of another shape": lambda c: {**c, "spread": c["spread"][:1]},
    "mean of another shape": lambda c: {**c, "mean": c["mean"][:, :2]},
    "mean that is a word": lambda c: {**c, "mean": "x"},
    "no mean": lambda c: {key: x for key, x in c.items() if key != "mean"},
    "no meta": lambda c: {key: x for key, x in c.items() if key != "meta"},
    "meta that is none": lambda c: {**c, "meta": "{"},
    "a list": lambda c: [c],
    "one tensor": lambda c: c["mean"],
    "another arm": lambda c: _stated(c, digest="another"),
    "another format": lambda c: _stated(c, format=7),
    "more joints": lambda c: _stated(c, "trajectory", joints=7, home=[0.0] * 7),
    "more harmonics": lambda c: _stated(c, "trajectory", harmonics=9),
    "no period": lambda c: _stated(c, "trajectory", period=0.0),
    "an unknown body": lambda c: _stated(c, "network", body="vit"),
    "a width beyond all memory": lambda c: _stated(c, "network", width=10**6),
    "a negative width": lambda c: _stated(c, "network", width=-4),
    "an unknown activation": lambda c: _stated(c, "network", activation="x"),
    "limits without numbers": lambda c: _stated(c, limited=True),
    "limits of nothing": lambda c: _stated(
        {**c, "room": torch.zeros(2, 2), "speed": torch.ones(2)}, limited=True
    ),
}


def _load_stamp(spoil: Callable[[Path], object], folder: Path) -> None:
    artifact = folder / "artifact"
    write_json(artifact / "report.json", {"valid_share": 0.5})
    write_stamp(artifact, {"maker": "library"})
    spoil(artifact)
    read_stamp(artifact)


def _edited(**changes: Any) -> Callable[[Path], None]:
    def edit(artifact: Path) -> None:
        write_json(artifact / STAMP, read_json(artifact / STAMP) | changes)

    return edit


def _piped(artifact: Path) -> None:
    (artifact / "report.json").unlink()
    os.mkfifo(artifact / "report.json")


_STAMPS: dict[str, Callable[[Path], object]] = {
    "an edited report": lambda artifact: write_json(artifact / "report.json", {"valid_share": 1.0}),
    "no report": lambda artifact: (artifact / "report.json").unlink(),
    "no stamp": lambda artifact: (artifact / STAMP).unlink(),
    "an empty stamp": lambda artifact: (artifact / STAMP).write_text(""),
    "a list": lambda artifact: (artifact / STAMP).write_text("[]"),
    "no files": _edited(files=None),
    "a file elsewhere": _edited(files={"../../../../../etc/none": "0"}),
    "a pipe as report": _piped,
}


def _noise(folder: Path) -> Path:
    (folder / "x").write_bytes(np.random.default_rng(0).bytes(5000))
    return folder / "x"


def _pipe(folder: Path) -> Path:
    os.mkfifo(folder / "x")
    return folder / "x"


def _empty(folder: Path) -> Path:
    (folder / "x").touch()
    return folder / "x"


_ANY: dict[str, Callable[[Path], Path]] = {
    "noise": _noise,
    "a pipe": _pipe,
    "nothing": _empty,
    "a folder": lambda folder: folder,
    "an endless device": lambda folder: Path("/dev/zero"),
    "a missing file": lambda folder: folder / "gone",
    "a NUL in the name": lambda folder: folder / "a\0b",
}
_LOADERS: dict[str, Callable[[Path], object]] = {
    "library": lambda path: load_foreign(path, load_robot("planar2")),
    "generator": TrajectoryGenerator.load,
    "JSON": read_json,
}
