"""Seeds that took long to make, in one small file that is taken in place of making them again."""

import json
from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.storage import read_arrays, write_arrays
from sidegan.seeding.result import SeedBatch


def ship(path: Path, stamp: Mapping[str, Any], batch: SeedBatch) -> None:
    """Write seeds in single precision, with what they were made by."""
    seeds = replace(batch, coefficients=batch.coefficients.astype(np.float32)).arrays()
    write_arrays(path, {"stamp": np.array(json.dumps(stamp)), **seeds})


def shipped(path: Path, stamp: Mapping[str, Any], count: int) -> SeedBatch | None:
    """The first seeds of a file; None where others or fewer are there, or no file."""
    if not path.exists():
        return None
    arrays = read_arrays(path)
    seeds = SeedBatch.of(arrays)
    if json.loads(arrays["stamp"].item()) != stamp or len(seeds) < count:
        return None
    c, spent = seeds.coefficients[:count].astype(float), seeds.cpu_seconds * count / len(seeds)
    return replace(seeds, coefficients=c, fitness=seeds.fitness[:count], cpu_seconds=spent)
