"""Speed-up over workers: measured on one and more here, and by a model of many.

python -m benchmarks.speedup [--workers 2] [--engine dask] [--quick] [--json FILE]

The model knows how long each task took on one worker and what the engine costs: opening its workers, handing
out a task, starting one. It gives tasks to whichever worker is free first. It is checked against what was
measured here; for many workers it takes each to have a core, and memory bandwidth, of its own.
"""

import argparse
import dataclasses
import heapq
import itertools
import json
import os
import pickle
import platform
import statistics
import sys
import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import torch
from torch import Tensor

from benchmarks.setting import Setting
from sidegan.base.parallel import Report, engine, run_jobs
from sidegan.design.problem import Problem
from sidegan.identification import RIGID, Noise, TorqueModel, estimate, measure
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.seeds import Gradient
from sidegan.validity import Constraints, check

MANY = (8, 64)  # workers that the model is asked about
_EMPTY = 400  # jobs that do nothing, to measure what handing out costs
_RATE = 100  # [Hz] of the measurements

Task = Callable[[], Any]


@dataclass(frozen=True)
class Overhead:
    """What an engine costs [s].

    Attributes:
        start: of workers, once per run.
        opening: of every further call.
        handing: of a task, at the one who hands out.
        starting: of a task, at the worker, beside the task itself.
    """

    start: float
    opening: float
    handing: float
    starting: float


@dataclass(frozen=True)
class Speedup:
    """One kind of work.

    Attributes:
        name: of the work.
        tasks: that were run here.
        seconds: median duration of a task on one worker.
        bytes: size of a task on its way to a worker.
        slower: how many times longer a task took beside the others.
        measured: wall time by number of workers [s].
        predicted: the same by the model.
        beside: wall time on more workers by the model, with tasks as slow as they were beside each other [s].
        same: whether the results were equal to the last bit.
        paper_tasks: that the work consists of at the paper's scale.
        many: predicted speed-up of those by number of workers.
    """

    name: str
    tasks: int
    seconds: float
    bytes: int
    slower: float
    measured: dict[int, float]
    predicted: dict[int, float]
    beside: float
    same: bool
    paper_tasks: int
    many: dict[int, float]


def works(setting: Setting) -> dict[str, tuple[list[Task], int]]:
    """Tasks of each kind of work, and how many there are at the paper's scale."""
    problem, constraints, family = setting.problem, setting.constraints, setting.trajectory
    batch, drawn, steps = setting.size(50), setting.size(1000), setting.size(60)
    few = setting.start(4 if setting.quick else 35)
    seeds = np.random.SeedSequence(0).spawn(8)
    return {
        # 1800 seeds in tasks of 50
        "seeds": ([partial(_seeds, problem, Gradient(steps=steps, attempts=1), batch, s) for s in seeds], 36),
        # a library of a million in tasks of 1000
        "library filtering": (
            [partial(_filter, constraints, family, problem, drawn, s) for s in seeds],
            1000,
        ),
        # six sets with ten noise realisations each
        "identification": ([partial(_identify, setting.body, family, few, s) for s in seeds], 60),
    }


def _seeds(problem: Problem, method: Gradient, count: int, seed: np.random.SeedSequence) -> Tensor:
    return method.optimise(problem, count, seed).coefficients


def _filter(
    constraints: Constraints,
    family: Trajectory,
    problem: Problem,
    count: int,
    seed: np.random.SeedSequence,
) -> Tensor:
    generator = torch.Generator().manual_seed(int(seed.generate_state(1)[0]))
    c = problem.start(count, generator)
    return c[check(constraints, family, c).valid]


def _identify(body: RigidBody, family: Trajectory, c: Tensor, seed: np.random.SeedSequence) -> Tensor:
    motion = family.roll_out(c, family.times(_RATE))
    noise = Noise("multiplicative", 0.1, torque=True, state=False)
    data = measure(body, motion, noise, np.random.default_rng(seed))
    return estimate("weighted", TorqueModel(body, RIGID), data).parameters


def _timed(task: Task, report: Report) -> tuple[Any, float]:
    began = time.perf_counter()
    return task(), time.perf_counter() - began


def _nothing() -> None:
    pass


def overhead(workers: int) -> Overhead:
    """What the engine costs, by jobs that do nothing."""
    few = [partial(_timed, _nothing)] * workers
    start, opening = (_wall(few, workers) for _ in range(2))
    began = time.process_time()
    wall = _wall([partial(_timed, _nothing)] * _EMPTY, workers) - opening
    handing = (time.process_time() - began) / _EMPTY  # CPU time here: tasks wait for one another for so long
    return Overhead(start, opening, handing, max(workers * wall / _EMPTY, 0.0))


def _wall(jobs: Sequence[Any], workers: int) -> float:
    began = time.perf_counter()
    run_jobs("nothing", jobs, workers)
    return time.perf_counter() - began


def predict(seconds: Sequence[float], workers: int, costs: Overhead) -> float:
    """Wall time [s] of tasks that take so long each; one worker works in the process itself."""
    if workers == 1:
        return sum(seconds)
    free = [0.0] * workers
    for index, duration in enumerate(seconds, 1):
        begins = max(heapq.heappop(free), index * costs.handing)
        heapq.heappush(free, begins + costs.starting + duration)
    return costs.opening + max(free)


def compare(name: str, tasks: Sequence[Task], paper: int, workers: int, costs: Overhead) -> Speedup:
    """One kind of work on one worker and on more."""
    jobs = [partial(_timed, task) for task in tasks]
    run_jobs(name, jobs[:1], 1)  # what is compiled or cached at first use
    run_jobs(name, jobs[:workers], workers)
    measured, runs = {}, {}
    for count in (1, workers):
        began = time.perf_counter()
        runs[count] = run_jobs(name, jobs, count)
        measured[count] = time.perf_counter() - began
    alone, beside = ([seconds for _, seconds in runs[count]] for count in (1, workers))
    slower = sum(beside) / sum(alone)
    whole = list(itertools.islice(itertools.cycle(alone), paper))
    return Speedup(
        name,
        len(tasks),
        statistics.median(alone),
        len(pickle.dumps(jobs[0])),
        slower,
        measured,
        {count: predict(alone, count, costs) for count in (1, workers)},
        predict([slower * seconds for seconds in alone], workers, costs),
        all(torch.equal(one, other) for (one, _), (other, _) in zip(*runs.values())),
        paper,
        {many: sum(whole) / predict(whole, many, costs) for many in MANY},
    )


def show(found: Sequence[Speedup], costs: Overhead, workers: int, name: str) -> None:
    """Print the overhead and one table."""
    print(
        f"{name}, {workers} workers: {costs.start:.2f} s to start, {1e3 * costs.opening:.0f} ms per call, "
        f"{1e3 * costs.handing:.2f} ms to hand out a task, {1e3 * costs.starting:.1f} ms to start one\n"
    )
    many = [f"model: {count} workers" for count in MANY]
    head = ["work", "tasks", "s/task", "kB/task", f"speed-up on {workers}", "model", "model, as slow as here"]
    head += ["slower beside", "same to the last bit", "tasks in the paper", *many]
    print("| " + " | ".join(head) + " |\n" + "| --- " * len(head) + "|")
    for one in found:
        alone = one.measured[1]
        cells = [one.name, str(one.tasks), f"{one.seconds:.3g}", f"{one.bytes / 1e3:.1f}"]
        cells += [f"{alone / one.measured[workers]:.2f}", f"{alone / one.predicted[workers]:.2f}"]
        cells += [f"{alone / one.beside:.2f}", f"{one.slower:.2f}", "yes" if one.same else "NO"]
        cells += [str(one.paper_tasks), *(f"{one.many[count]:.1f}" for count in MANY)]
        print("| " + " | ".join(cells) + " |")


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code: 0, or 1 when results depend on the number of workers."""
    parser = argparse.ArgumentParser(
        prog="python -m benchmarks.speedup", description="Speed-up over workers."
    )
    parser.add_argument("--workers", type=int, default=2, help="to compare with one (default 2)")
    parser.add_argument("--engine", choices=("loky", "dask"), default="loky")
    parser.add_argument("--scheduler", help="address of a Dask scheduler; a cluster is started here without")
    parser.add_argument("--quick", action="store_true", help="a tenth of the work: does everything run?")
    parser.add_argument("--json", type=Path, metavar="FILE", help="write what was found there too")
    chosen = parser.parse_args(arguments)
    if chosen.workers < 2:
        parser.error(f"--workers is {chosen.workers}, expected at least 2")
    torch.set_num_threads(1)
    with engine(chosen.engine, chosen.scheduler):
        costs = overhead(chosen.workers)
        found = []
        for name, (tasks, paper) in works(Setting(chosen.quick)).items():
            sys.stderr.write(f"{name} …\n")
            found.append(compare(name, tasks, paper, chosen.workers, costs))
    show(found, costs, chosen.workers, chosen.engine)
    if chosen.json is not None:
        machine = {
            "processor": platform.machine(),
            "cores": os.cpu_count(),
            "python": platform.python_version(),
        }
        result = {"machine": machine, "engine": chosen.engine, "overhead": dataclasses.asdict(costs)}
        rows = [dataclasses.asdict(one) for one in found]
        chosen.json.write_text(json.dumps({**result, "rows": rows}, indent=2), encoding="utf-8")
    return 0 if all(one.same for one in found) else 1


if __name__ == "__main__":
    sys.exit(main())
