"""Seeds that took long to make, in one small file that is taken in place of making them again."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

from sidegan.base.storage import read_torch, write_torch
from sidegan.seeding.result import SeedBatch


def ship(path: Path, stamp: Mapping[str, Any], batch: SeedBatch) -> None:
    """Write seeds in single precision, with what they were made by."""
    seeds = vars(replace(batch, coefficients=batch.coefficients.float()))
    write_torch(path, {"stamp": dict(stamp), "seeds": seeds})


def shipped(path: Path, stamp: Mapping[str, Any], count: int) -> SeedBatch | None:
    """The first seeds of a file; None where others or fewer are there, or no file."""
    if not path.exists():
        return None
    content = read_torch(path)
    seeds = SeedBatch(**content["seeds"])
    if content["stamp"] != stamp or len(seeds) < count:
        return None
    c, spent = seeds.coefficients[:count].double(), seeds.cpu_seconds * count / len(seeds)
    return replace(seeds, coefficients=c, fitness=seeds.fitness[:count], cpu_seconds=spent)
