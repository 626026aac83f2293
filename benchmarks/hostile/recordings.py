"""Recordings that cannot be used: tables with wrong columns, clocks and numbers, and files that are none."""

import os
from collections.abc import Callable, Iterator
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch

from benchmarks.hostile.case import Case
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.run import composed
from sidegan.pipeline.settings import Config
from sidegan.pipeline.stages.identify import checked
from sidegan.robot import load_robot

_RATE, _SECONDS = 100, 12
Table = Any  # a pandas data frame


@cache
def good(seed: int = 0) -> Table:
    """A recording of planar2 that there is nothing to say against."""
    arm, random = load_robot("planar2"), np.random.default_rng(seed)
    t = np.arange(_RATE * _SECONDS)[:, None, None] / _RATE
    w, phase = 2 * np.pi * np.arange(1, 5) / 6, random.uniform(0, 6, (2, 4))
    size = 0.25 * random.uniform(0.5, 1, (2, 4))
    q = (size * np.sin(w * t + phase)).sum(2)
    v = (size * w * np.cos(w * t + phase)).sum(2)
    a = (-size * w**2 * np.sin(w * t + phase)).sum(2)
    torque = RigidBody(arm).torque(*(torch.from_numpy(x) for x in (q, v, a))).numpy()
    torque = torque + 0.5 * v + 0.01 * random.normal(size=v.shape)
    columns = {f"{letter}{j + 1}": x[:, j] for letter, x in (("q", q), ("tau", torque)) for j in range(2)}
    return pd.DataFrame({"t": t[:, 0, 0], **columns})


@cache
def _settings() -> Config:
    return composed("+experiment=identify", "robot=planar2", "tracking=off")


def check(*paths: Path, validation: tuple[Path, ...] = ()) -> None:
    """Check recordings, as stages ``check`` and ``identify`` do."""
    training, held_out = ([str(path) for path in files] for files in (paths, validation))
    checked(replace(_settings(), recordings=training, validation=held_out), load_robot("planar2"))


_TABLES: dict[str, Callable[[Table], Table]] = {
    "no time": lambda x: x.drop(columns="t"),
    "no position": lambda x: x.drop(columns=["q1", "q2"]),
    "half the positions": lambda x: x.drop(columns="q2"),
    "half the torques": lambda x: x.drop(columns="tau1"),
    "no torque": lambda x: x.drop(columns=["tau1", "tau2"]),
    "a third joint": lambda x: x.assign(q3=0.1, tau3=0.1),
    "other names": lambda x: x.rename(columns=lambda name: f"joint {name}"),
    "no rows": lambda x: x.iloc[:0],
    "one row": lambda x: x.iloc[:1],
    "nine rows": lambda x: x.iloc[:9],
    "a tenth of a second": lambda x: x.iloc[:12],
    "no numbers": lambda x: x.assign(q1=np.nan),
    "mostly no numbers": lambda x: x.assign(tau2=x.tau2.where(x.index % 4 == 0)),
    "no time stamps": lambda x: x.assign(t=np.nan),
    "infinite positions": lambda x: x.assign(q1=np.inf),
    "infinite time": lambda x: x.assign(t=np.inf),
    "zero torques": lambda x: x.assign(tau1=0.0, tau2=0.0),
    "constant torques": lambda x: x.assign(tau1=1.0, tau2=2.0),
    "an arm at rest": lambda x: x.assign(q1=0.3, q2=0.1),
    "degrees": lambda x: x.assign(q1=x.q1 * 57.3, q2=x.q2 * 57.3),
    "time backwards": lambda x: x.iloc[::-1],
    "one step back": lambda x: x.assign(t=x.t.where(x.index != 500, 0.0)),
    "one time": lambda x: x.assign(t=1.0),
    "huge positions": lambda x: x.assign(q1=x.q1 * 1e300),
    "huge torques": lambda x: x.assign(tau1=x.tau1 * 1e300),
    "huge times": lambda x: x.assign(t=x.t * 1e300),
    "tiny times": lambda x: x.assign(t=x.t * 1e-300),
    "words": lambda x: x.assign(q1="left"),
    "dates": lambda x: x.assign(t=pd.Timestamp("2026-01-01").isoformat()),
    "shuffled": lambda x: x.sample(frac=1.0, random_state=0),
}


def _npz(table: Table, path: Path) -> None:
    np.savez(path, **{name: column.to_numpy() for name, column in table.items()})


_WRITERS: dict[str, Callable[[Table, Path], object]] = {
    "csv": lambda table, path: table.to_csv(path, index=False),
    "parquet": lambda table, path: table.to_parquet(path),
    "npz": _npz,
}


def cases() -> Iterator[Case]:
    """All of them."""
    good()  # made before the clock runs: kernels may have to be compiled
    for suffix in _WRITERS:
        for name in _TABLES:
            yield Case(f"recording: {name} ({suffix})", partial(_table, name, suffix))
        for share in (0.0, 0.1, 0.5, 0.98):
            if suffix != "csv" or share == 0:
                yield Case(f"recording: cut after {share:.0%} ({suffix})", partial(_cut, suffix, share))
        yield Case(f"recording: noise ({suffix})", partial(_noise, f"a.{suffix}"))
    for suffix in (".db3", ".mcap", ".xlsx", ".mat", "", ".csv.gz"):
        yield Case(f"recording: noise ({suffix or 'no suffix'})", partial(_noise, f"a{suffix}"))
    for name, act in _OTHERS.items():
        yield Case(f"recording: {name}", act, works=name in _FINE)


def _table(name: str, suffix: str, folder: Path) -> None:
    _WRITERS[suffix](_TABLES[name](good()), folder / f"a.{suffix}")
    check(folder / f"a.{suffix}")


def _cut(suffix: str, share: float, folder: Path) -> None:
    path = folder / f"a.{suffix}"
    _WRITERS[suffix](good(), path)
    content = path.read_bytes()
    path.write_bytes(content[: int(len(content) * share)])
    check(path)


def _noise(name: str, folder: Path) -> None:
    (folder / name).write_bytes(np.random.default_rng(0).bytes(4000))
    check(folder / name)


def _text(folder: Path, change: Callable[[str], str], encoding: str = "utf-8") -> Path:
    path = folder / "a.csv"
    path.write_bytes(change(good().to_csv(index=False)).encode(encoding))
    return path


def _pipe(folder: Path) -> Path:
    os.mkfifo(folder / "a.csv")
    return folder / "a.csv"


def _array(folder: Path, **arrays: Any) -> Path:
    np.savez(folder / "a.npz", **arrays)
    return folder / "a.npz"


def _arrays(**changes: Any) -> dict[str, Any]:
    return {name: column.to_numpy() for name, column in good().items()} | changes


def _bag(folder: Path, **files: bytes) -> Path:
    (folder / "bag").mkdir()
    for name, content in files.items():
        (folder / "bag" / name.replace("_", ".")).write_bytes(content)
    return folder / "bag"


def _pair(folder: Path, first: slice, second: slice) -> None:
    for name, rows in (("a.csv", first), ("b.csv", second)):
        good().iloc[rows].to_csv(folder / name, index=False)
    check(folder / "a.csv", validation=(folder / "b.csv",))


def _twice(folder: Path, header: str) -> None:
    check(_text(folder, lambda text: text.replace("t,q1,q2,tau1,tau2", header, 1)))


_FINE = {"a byte order mark", "semicolons"}
_OTHERS: dict[str, Callable[[Path], object]] = {
    "a byte order mark": lambda folder: check(_text(folder, str, "utf-8-sig")),
    "semicolons": lambda folder: check(_text(folder, lambda text: text.replace(",", ";"))),
    "UTF-16": lambda folder: check(_text(folder, str, "utf-16")),
    "no header": lambda folder: check(_text(folder, lambda text: text.partition("\n")[2])),
    "a column twice": partial(_twice, header="t,q1,q1,tau1,tau2"),
    "a header alone": partial(lambda folder: check(_text(folder, lambda text: text.partition("\n")[0]))),
    "one long line": lambda folder: check(_text(folder, lambda text: text.replace("\n", ","))),
    "decimal commas": lambda folder: check(_text(folder, lambda text: text.replace(".", ","))),
    "a pipe": lambda folder: check(_pipe(folder)),
    "an endless device": lambda folder: check(Path("/dev/zero")),
    "a device of noise": lambda folder: check(Path("/dev/urandom")),
    "a missing file": lambda folder: check(folder / "gone.csv"),
    "an empty folder": lambda folder: check(folder),
    "the whole disk": lambda folder: check(Path("/")),
    "a NUL in the name": lambda folder: check(folder / "a\0.csv"),
    "a name too long": lambda folder: check(folder / ("x" * 5000 + ".csv")),
    "complex numbers": lambda folder: check(_array(folder, **_arrays(q1=good().q1.to_numpy() + 0.1j))),
    "objects": lambda folder: check(_array(folder, **_arrays(q1=np.array([{}] * len(good()), dtype=object)))),
    "dates as an array": lambda folder: check(_array(folder, **_arrays(t=np.zeros(len(good()), "M8[ns]")))),
    "lengths that differ": lambda folder: check(_array(folder, **_arrays(q2=np.zeros(7)))),
    "one number": lambda folder: check(_array(folder, **_arrays(q2=np.float64(1)))),
    "a cube of numbers": lambda folder: check(_array(folder, **_arrays(q2=np.zeros((len(good()), 2, 2))))),
    "a bag that is none": lambda folder: check(_bag(folder, metadata_yaml=b"x: [")),
    "a bag with no data": lambda folder: check(
        _bag(folder, metadata_yaml=b"rosbag2_bagfile_information: {}")
    ),
    "a database that is none": lambda folder: check(_bag(folder, a_db3=b"SQLite format 3\0" + bytes(99))),
    "the same twice": lambda folder: _pair(folder, slice(None), slice(None)),
    "a part held out": lambda folder: _pair(folder, slice(None), slice(400, 900)),
    "parts that overlap": lambda folder: _pair(folder, slice(0, 800), slice(500, 1200)),
}
