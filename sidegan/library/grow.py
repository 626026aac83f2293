"""Libraries larger than memory, from generator to file: drawn, checked, measured and written by parts."""

import logging
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import opened_parquet
from sidegan.design.excitation import Excitation, diversity
from sidegan.library.collection import Library
from sidegan.library.draw import Draws, Expansion
from sidegan.library.measure import measured
from sidegan.library.stream import save_parts, take
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check

log = logging.getLogger(__name__)

WHOLE = 50_000  # trajectories up to which a library is made in memory: 0.2 GB with all its copies
_PART = 5_000  # trajectories of a row group
_SAMPLED = 20_000  # trajectories that stand for all where all are too many
_NEIGHBOURS = 500  # trajectories whose nearest ones are looked for among all


@dataclass(frozen=True)
class Growth:
    """How trajectories are made and checked: what to draw (count) → (count, J, H, 2), the arm, the family."""

    sample: Callable[[int], Tensor]
    constraints: Constraints
    trajectory: Trajectory
    source: str  # name of who makes them


def grow(path: Path, growth: Growth, settings: Expansion, report: Report = lambda done, total: None) -> Draws:
    """How many were drawn for a library that is now in a file; its coefficients are not kept in memory.

    The trajectories are those that ``draw_valid`` would give.

    Raises:
        InfeasibleError: when fewer than ``settings.least`` are valid.
    """
    draws = _Draws(growth, settings, report)
    first = next(parts := draws.parts(), None)
    if first is None:
        return draws.outcome().require(max(1, settings.least), f"drawn from {growth.source}")

    def every() -> Iterator[Library]:
        yield first
        yield from parts

    save_parts(path, every())
    return draws.outcome().require(settings.least, f"drawn from {growth.source}")


class _Draws:
    """Valid trajectories, part by part, and the count of what was drawn for them."""

    def __init__(self, growth: Growth, settings: Expansion, report: Report) -> None:
        self.growth, self.settings, self.report = growth, settings, report
        self.drawn = self.valid = self.last = 0
        self.faults: dict[str, int] = {}

    def outcome(self) -> Draws:
        """What ``draw_valid`` tells, without coefficients."""
        count = self.settings.count
        return Draws(torch.empty(0), count, self.drawn, self.valid, self.last, self.faults)

    def parts(self) -> Iterator[Library]:
        """Measured parts of the library, of the first ``count`` valid trajectories."""
        growth, kept, held, given = self.growth, [], 0, 0
        for c in self._valid():
            kept.append(c[: self.settings.count - given - held])
            held += len(kept[-1])
            if held >= _PART:
                yield measured(growth.constraints, growth.trajectory, torch.cat(kept), growth.source)
                kept, given, held = [], given + held, 0
        if held:
            yield measured(growth.constraints, growth.trajectory, torch.cat(kept), growth.source)

    def _valid(self) -> Iterator[Tensor]:
        growth, settings = self.growth, self.settings
        while self.valid < settings.count and self.drawn < settings.draws:
            c = growth.sample(min(settings.batch, settings.draws - self.drawn))
            verdict = check(growth.constraints, growth.trajectory, c)
            good = c[verdict.valid]
            self.drawn, self.valid, self.last = self.drawn + len(c), self.valid + len(good), len(c)
            if self.drawn >= settings.draws and self.valid < settings.count:
                self.faults = dict(verdict.faults())
            self.report(min(self.valid, settings.count), settings.count)
            if len(good):
                yield good


def sample_of(path: Path) -> Library:
    """Trajectories of a library's file that stand for all of it, in random order."""
    with opened_parquet(path) as file:
        count = file.metadata.num_rows
    return take(path, torch.randperm(count, generator=torch.Generator().manual_seed(0))[:_SAMPLED])


def summary_of(path: Path, sample: Library) -> dict[str, float]:
    """The same as ``summary`` of a library's file: of a sample, but for medians and nearest neighbours."""
    with opened_parquet(path) as file:
        table = file.read(columns=["fitness", "diagonal_fitness", "valid"])
    count = table.num_rows
    log.info("diversity of %d trajectories is estimated from a sample of %d", count, len(sample))
    medians = {
        name: float(torch.from_numpy(np.array(table[column]).copy()).median())
        for name, column in (("condition", "fitness"), ("diagonal_ratio", "diagonal_fitness"))
    }
    valid = float(np.array(table["valid"]).mean())
    diverse = diversity(sample.coefficients, Excitation(sample.spectrum, sample.diagonal))
    return {"count": count, "valid": valid, **medians, **diverse, "nearest": _nearest(path, sample)}


def _nearest(path: Path, sample: Library) -> float:
    """Mean distance of some trajectories to their nearest other one in the whole file."""
    rows = sample.coefficients[:_NEIGHBOURS].flatten(1)
    two = torch.full((len(rows), 2), torch.inf, dtype=torch.float64)  # each one itself, and its nearest other
    with opened_parquet(path) as file:
        for group in range(file.num_row_groups):
            column = file.read_row_group(group, columns=["coefficients"])["coefficients"].combine_chunks()
            values = np.array(column.flatten().to_numpy(zero_copy_only=False))
            others = torch.from_numpy(values).reshape(len(column), -1)
            distances = torch.cdist(rows, others, compute_mode="donot_use_mm_for_euclid_dist")
            two = torch.cat([two, distances], 1).topk(2, 1, largest=False).values
    return float(two[:, 1].mean())
