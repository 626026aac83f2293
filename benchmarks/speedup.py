"""Speed-up over workers: measured on one and more here, and by a model of many.

python -m benchmarks.speedup [--workers 2] [--engine dask] [--quick]

The model knows how long each task took on one worker and what the engine costs: opening its workers, handing
out a task, starting one. It gives tasks to whichever worker is free first. It is checked against what was
measured here; for many workers it takes each to have a core, and memory bandwidth, of its own.
"""

import argparse
import heapq
import itertools
import pickle
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from benchmarks.setting import Setting
from sidegan.base.parallel import Job, Report, engine, run_jobs
from sidegan.identification import RIGID, Noise, TorqueModel, estimate, measure
from sidegan.report.export import markdown
from sidegan.seeds import Gradient
from sidegan.validity import check

MANY = (8, 64)  # workers that the model is asked about
PAPER = {"seeds": 36, "library filtering": 1000, "identification": 60}  # tasks at the paper's scale
_TASKS = 8  # of each kind
_EMPTY = 400  # jobs that do nothing, to measure what handing out costs

Task = Callable[[], Any]


class Overhead(NamedTuple):
    """What an engine costs [s]: its start, every further call, to hand out a task, to start it there."""

    start: float
    opening: float
    handing: float
    starting: float


def works(setting: Setting) -> dict[str, list[Task]]:
    """Tasks of each kind of work: seeds of 50, libraries of 1000, noise realisations of a set of 35."""
    steps, few = setting.size(60), setting.start(4 if setting.quick else 35)
    kinds: dict[str, Callable[..., Any]] = {
        "seeds": partial(_seeds, setting, Gradient(steps=steps, attempts=1, reserve=0.2), setting.size(50)),
        "library filtering": partial(_filter, setting, setting.size(1000)),
        "identification": partial(_identify, setting, few),
    }
    numbers = np.random.SeedSequence(0).spawn(_TASKS)
    return {name: [partial(kind, number) for number in numbers] for name, kind in kinds.items()}


def _seeds(setting: Setting, method: Gradient, count: int, seed: np.random.SeedSequence) -> Tensor:
    return method.optimise(setting.problem, count, seed).coefficients


def _filter(setting: Setting, count: int, seed: np.random.SeedSequence) -> Tensor:
    generator = torch.Generator().manual_seed(int(seed.generate_state(1)[0]))
    c = setting.problem.start(count, generator)
    return c[check(setting.problem.constraints, setting.problem.trajectory, c).valid]


def _identify(setting: Setting, c: Tensor, seed: np.random.SeedSequence) -> Tensor:
    motion = setting.problem.trajectory.roll_out(c, setting.problem.trajectory.times(100.0))
    noise = Noise("multiplicative", 0.1, torque=True, state=False)
    measured = measure(setting.problem.body, motion, noise, np.random.default_rng(seed))
    return estimate("weighted", TorqueModel(setting.problem.body, RIGID), measured).parameters


def overhead(workers: int) -> Overhead:
    """What the engine costs, by jobs that do nothing."""
    job = partial(_timed, _nothing)
    start, opening = (_wall([job] * workers, workers)[1] for _ in range(2))
    began = time.process_time()
    wall = _wall([job] * _EMPTY, workers)[1] - opening
    handing = (time.process_time() - began) / _EMPTY  # CPU time here: tasks wait for one another for so long
    return Overhead(start, opening, handing, max(workers * wall / _EMPTY, 0.0))


def predict(seconds: Sequence[float], workers: int, costs: Overhead) -> float:
    """Wall time [s] of tasks that take so long each; one worker works in the process itself."""
    if workers == 1:
        return sum(seconds)
    free = [0.0] * workers
    for index, duration in enumerate(seconds, 1):
        begins = max(heapq.heappop(free), index * costs.handing)
        heapq.heappush(free, begins + costs.starting + duration)
    return costs.opening + max(free)


def compare(name: str, tasks: Sequence[Task], workers: int, costs: Overhead) -> dict[str, Any]:
    """A row of the table: one kind of work on one worker and on more."""
    jobs: list[Job] = [partial(_timed, task) for task in tasks]
    for count in (1, workers):
        run_jobs(name, jobs[:count], count)  # what is compiled or cached at first use
    (one, wall), (more, wall_more) = (_wall(jobs, count) for count in (1, workers))
    alone, beside = ([seconds for _, seconds in results] for results in (one, more))
    slower = sum(beside) / sum(alone)
    whole = list(itertools.islice(itertools.cycle(alone), PAPER[name]))
    same = all(torch.equal(a, b) for (a, _), (b, _) in zip(one, more))
    return {
        "work": name,
        "tasks": len(tasks),
        "s/task": f"{statistics.median(alone):.3g}",
        "kB/task": f"{len(pickle.dumps(jobs[0])) / 1e3:.1f}",
        f"speed-up on {workers}": f"{wall / wall_more:.2f}",
        "model": f"{wall / predict(alone, workers, costs):.2f}",
        "model, as slow as here": f"{wall / predict([slower * x for x in alone], workers, costs):.2f}",
        "slower beside": f"{slower:.2f}",
        "same to the last bit": "yes" if same else "NO",
        "tasks in the paper": PAPER[name],
        **{f"model: {many} workers": f"{sum(whole) / predict(whole, many, costs):.1f}" for many in MANY},
    }


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code: 0, or 1 when results depend on the number of workers."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.speedup", description="Speed-up over workers."
    )
    parser.add_argument("--workers", type=int, default=2, help="to compare with one (default 2)")
    parser.add_argument("--engine", choices=("loky", "dask"), default="loky")
    parser.add_argument("--scheduler", help="address of a Dask scheduler; a cluster is started here without")
    parser.add_argument("--quick", action="store_true", help="a tenth of the work: does everything run?")
    options = parser.parse_args(arguments)
    if options.workers < 2:
        parser.error(f"--workers is {options.workers}, expected at least 2")
    torch.set_num_threads(1)
    with engine(options.engine, options.scheduler):
        costs = overhead(options.workers)
        kinds = works(Setting(options.quick))
        rows = [compare(name, tasks, options.workers, costs) for name, tasks in kinds.items()]
    start, *rest = costs.start, *(1e3 * seconds for seconds in costs[1:])
    words = "{:.0f} ms per call, {:.2f} ms to hand out a task, {:.1f} ms to start one\n".format(*rest)
    print(f"{options.engine}, {options.workers} workers: {start:.2f} s to start, {words}")
    print(markdown(pd.DataFrame(rows)))
    return 0 if all(row["same to the last bit"] == "yes" for row in rows) else 1


def _timed(task: Task, report: Report) -> tuple[Any, float]:
    began = time.perf_counter()
    return task(), time.perf_counter() - began


def _nothing() -> None:
    pass


def _wall(jobs: Sequence[Job], workers: int) -> tuple[list[Any], float]:
    """Results of the jobs, and how long they took [s]."""
    began = time.perf_counter()
    return run_jobs("benchmark", jobs, workers), time.perf_counter() - began


if __name__ == "__main__":
    sys.exit(main())
