"""Results of optimisers: provably valid seeds, and why other starts failed."""

import json
from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.storage import read_arrays, write_arrays
from sidegan.errors import ArtifactError, InfeasibleError
from sidegan.validity import Constraints, summarise_faults
from sidegan.validity.remedies import remedy


@dataclass(frozen=True)
class SeedBatch:
    """Valid seeds, and statistics of their optimisation."""

    coefficients: Array  # of valid seeds [rad/s], (n, J, H, 2)
    fitness: Array  # condition numbers of YᵀY, (n,)
    attempts: int = 0  # starts that were optimised
    failed: int = 0  # starts that did not become valid seeds
    faults: dict[str, int] = field(default_factory=dict)  # number of failed starts by violation
    cpu_seconds: float = 0.0  # including failures

    def __len__(self) -> int:
        return len(self.coefficients)

    @classmethod
    def join(cls, batches: Iterable["SeedBatch"]) -> "SeedBatch":
        """All batches, at least one, joined in order."""
        parts = list(batches)
        return cls(
            np.concatenate([part.coefficients for part in parts]),
            np.concatenate([part.fitness for part in parts]),
            sum(part.attempts for part in parts),
            sum(part.failed for part in parts),
            dict(sum((Counter(part.faults) for part in parts), Counter[str]())),
            sum(part.cpu_seconds for part in parts),
        )

    @classmethod
    def of(cls, arrays: Mapping[str, Array]) -> "SeedBatch":
        """A batch from a file's arrays; ArtifactError if they are not a batch."""
        try:
            return cls(arrays["coefficients"], arrays["fitness"], **json.loads(arrays["origin"].item()))
        except (KeyError, TypeError, ValueError) as error:
            held = ", ".join(arrays)
            raise ArtifactError(
                f"the file holds {held}, expected coefficients, fitness and origin"
            ) from error

    def arrays(self) -> dict[str, Array]:
        """Arrays for a file, of numbers and text."""
        origin = {name: x for name, x in vars(self).items() if name not in ("coefficients", "fitness")}
        text = np.array(json.dumps(origin))
        return {"coefficients": self.coefficients, "fitness": self.fitness, "origin": text}

    def best(self, count: int) -> "SeedBatch":
        """The ``count`` seeds with the least fitness, or all, in their order."""
        kept = np.sort(np.argsort(self.fitness)[:count])
        return replace(self, coefficients=self.coefficients[kept], fitness=self.fitness[kept])

    def shortfall(self, constraints: Constraints, count: int) -> InfeasibleError:
        """Error that says why there are fewer than ``count`` seeds."""
        why = summarise_faults(self.faults) or "no start was finished"
        worst, _, where = max(self.faults, key=self.faults.__getitem__, default="").partition(" of ")
        helps = f", or {remedy(constraints, (worst, where))}" if where else ""
        return InfeasibleError(
            f"only {len(self)} of {count} seeds became valid in {self.attempts} starts; "
            f"of those that failed, {why}; what may help: a home with more room around it "
            f"('trajectory.home=[…]'), a longer period (trajectory.period=…){helps}"
        )


def ship(path: Path, stamp: Mapping[str, Any], batch: SeedBatch) -> None:
    """Write seeds that took long to make, in single precision, with a stamp of what made them."""
    seeds = replace(batch, coefficients=batch.coefficients.astype(np.float32)).arrays()
    write_arrays(path, {"stamp": np.array(json.dumps(stamp)), **seeds})


def shipped(path: Path, stamp: Mapping[str, Any], count: int) -> SeedBatch | None:
    """The first ``count`` seeds of a file by ``ship``; None if it is missing, short or has another stamp."""
    if not path.exists():
        return None
    arrays = read_arrays(path)
    seeds = SeedBatch.of(arrays)
    if json.loads(arrays["stamp"].item()) != stamp or len(seeds) < count:
        return None
    return replace(
        seeds,
        coefficients=seeds.coefficients[:count].astype(float),
        fitness=seeds.fitness[:count],
        cpu_seconds=seeds.cpu_seconds * count / len(seeds),
    )
