"""A library of very many trajectories of the LWR: what the stage does, from generator to file and report."""

import resource
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import NamedTuple

import torch
from torch import Tensor

from benchmarks.setting import Setting
from sidegan.library.draw import Expansion
from sidegan.library.grow import Growth, grow, sample_of, summary_of

MANY, SOME, FEW = 1_000_000, 200_000, 2_000  # trajectories: the goal, what is measured, in a small run
_SHRUNK = 0.35  # of random trajectories, so that most are valid, as those of a trained generator are


class Grown(NamedTuple):
    """What a library of so many trajectories took: seconds, peak memory of the process and file [GB]."""

    trajectories: int
    seconds: float
    memory: float
    file: float
    valid_share: float


def grown(count: int) -> Grown:
    """Make one."""
    torch.set_num_threads(1)
    problem, generator = Setting().problem, Setting().untrained()
    noise = torch.Generator().manual_seed(0)

    def sample(size: int) -> Tensor:
        return _SHRUNK * generator.sample(size, noise)

    began = time.monotonic()
    with TemporaryDirectory() as folder:
        path = Path(folder, "library.parquet")
        growth = Growth(sample, problem.constraints, problem.trajectory, "untrained")
        draws = grow(path, growth, Expansion(count, 500, 10 * count, 1, 0, 0.0))
        summary_of(path, sample_of(path))
        size = path.stat().st_size / 1e9
    memory = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
    return Grown(count, time.monotonic() - began, memory, size, draws.valid / draws.drawn)


def measured(counts: tuple[int, ...]) -> list[Grown]:
    """The same for each count, in a process of its own each."""
    with ProcessPoolExecutor(1, get_context("forkserver"), max_tasks_per_child=1) as pool:
        return list(pool.map(grown, counts))
