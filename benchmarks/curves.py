"""The points of the growth curves: what one costs, as plain numbers; a function for each curve."""

import resource
import time
from collections import Counter
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from torch import Tensor

from benchmarks.data import noiseless
from benchmarks.setting import DESK, Setting
from benchmarks.timing import medians, timed
from sidegan.design.excitation import excite
from sidegan.design.greedy import greedy
from sidegan.design.objective import value_and_gradient
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.identification import RIGID, TorqueModel
from sidegan.identification.gather import gather
from sidegan.library import Library
from sidegan.library.measure import measured
from sidegan.library.stream import Diagonals, save_parts, take
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.seeds.gradient import Gradient
from sidegan.validity import Constraints, check

Point = dict[str, float]

_REPEATS = 5  # in one process
_BATCH = 50
_PART = 2_000  # trajectories of a library in memory at a time
_PICKS = 35
_STEPS = 200  # of every optimisation
_SAMPLES = 1600  # per trajectory that is identified from


def warm_up() -> None:
    """One thread, and the compiled kernels loaded, which no point should pay for."""
    torch.set_num_threads(1)
    problem = Setting().problem
    Gradient(steps=2, attempts=1, reserve=0.2).optimise(problem, 1, np.random.SeedSequence(0))
    excite(problem.body, problem.trajectory, problem.start(1, torch.Generator()))


def joints(count: int) -> Point:
    """CPU time per trajectory [ms] of YᵀY, its gradient with the penalty, and the check of validity."""
    arm = chain(Setting().problem.constraints.arm, count)
    return _costs(Problem(Constraints(arm, [DESK]), Trajectory(count)))


def samples(count: int) -> Point:
    """The same over the time points of the LWR's trajectories."""
    return _costs(replace(Setting().problem, samples=count))


def harmonics(count: int) -> Point:
    """The same over the harmonics, with as many time points as the highest needs."""
    problem = Setting().problem
    needed = max(problem.samples, 4 * count)
    return _costs(replace(problem, trajectory=Trajectory(7, count), samples=needed))


def seeds(count: int) -> Point:
    """CPU time per valid seed [s] of a batch, and the median condition number."""
    cost, condition, valid = _optimised(Setting().problem, count)
    return {"cpu_s_per_seed": cost / max(1, valid), "condition": condition}


def library(count: int) -> Point:
    """CPU time per trajectory [µs] of every step from noise to the selection, and the peak of memory [MB]."""
    setting = Setting()
    _library(setting, _PICKS)  # what is loaded at first use
    began = time.perf_counter()
    spent, size = _library(setting, count)
    return {
        **{f"{name}_us": 1e6 * seconds / count for name, seconds in spent.items()},
        "wall_s": time.perf_counter() - began,
        "file_mb": size,
        "peak_mb": _peak(),
    }


def rls(count: int) -> Point:
    """CPU time per sample [µs] to identify from so many trajectories of 1600 samples, and peak memory."""
    setting = Setting()
    recordings = noiseless(setting, 10, _SAMPLES)
    model = TorqueModel(setting.problem.body, RIGID)
    gather(model, recordings[0])
    run = timed(lambda: gather(model, (recordings[k % len(recordings)] for k in range(count))))
    each = 1e6 / (count * _SAMPLES)
    return {"cpu_us_per_sample": each * run.cpu, "cpu_s": run.cpu, "wall_s": run.wall, "peak_mb": _peak()}


def long(periods: int) -> Point:
    """CPU time [s] of a trajectory of so many periods of 16 s at their bandwidth, and of so many short ones.

    An optimiser without gradients must try each coefficient up and down before it may refine its step: its
    sweep is as many evaluations, of which one was measured.
    """
    short = Setting().problem
    family = Trajectory(7, 6 * periods, 16.0 * periods)
    problem = replace(short, trajectory=family, samples=short.samples * periods)
    c, c_short = (one.start(1, torch.Generator().manual_seed(0), 0.3) for one in (problem, short))
    works = (
        lambda: problem.fitness(c),
        lambda: value_and_gradient(problem, c, Penalty(30.0)),
        lambda: _evaluate(problem, c),
        lambda: _evaluate(short, c_short),
    )
    fitness, slope, evaluation, evaluation_short = (run.cpu for run in medians(_REPEATS, *works))
    one, one_condition, one_valid = _optimised(problem, 1, attempts=1)
    many, many_condition, many_valid = _optimised(short, periods, attempts=1)
    return {
        "coefficients": c.numel(),
        "fitness_s": fitness,
        "gradient_s": slope,
        "evaluation_s": evaluation,
        "sweep_long_s": 2 * c.numel() * evaluation,
        "sweep_short_s": 2 * c.numel() * evaluation_short,
        "one_long_s": one,
        "many_short_s": many,
        "one_long_valid": one_valid,
        "many_short_valid": many_valid,
        "one_long_condition": one_condition,
        "many_short_condition": many_condition,
    }


def _evaluate(problem: Problem, c: Tensor) -> None:
    """One evaluation: the condition number, and every constraint at every sample."""
    problem.constraints.margins(*(x.flatten(0, 1) for x in problem.motion(c)[1:]))
    problem.fitness(c)


def _optimised(problem: Problem, count: int, attempts: int = 5) -> tuple[float, float, int]:
    """CPU time of an optimisation [s], the median condition number, and how many became valid."""
    batch = Gradient(steps=_STEPS, attempts=attempts, reserve=0.2).optimise(
        problem, count, np.random.SeedSequence(0)
    )
    return batch.cpu_seconds, float(batch.fitness.median()) if len(batch) else float("nan"), len(batch)


def _library(setting: Setting, count: int) -> tuple[Counter[str], float]:
    """CPU time of each step [s], and size of the file [MB]."""
    generator, noise, spent = setting.untrained(), torch.Generator().manual_seed(0), Counter[str]()

    def parts() -> Iterator[Library]:
        for first in range(0, count, _PART):
            with _clock(spent, "generation"):
                c = generator.sample(min(_PART, count - first), noise)
            with _clock(spent, "measured"):
                part = measured(setting.problem.constraints, setting.problem.trajectory, c, "untrained")
            yield part

    with TemporaryDirectory() as folder:
        path = Path(folder) / "library.parquet"
        whole = timed(lambda: save_parts(path, parts())).cpu
        spent["write"] = whole - spent.total()  # type: ignore[assignment] # seconds
        with _clock(spent, "selection"):
            picked = greedy(Diagonals(path), min(_PICKS, count))
        with _clock(spent, "read"):
            take(path, picked)
        return spent, path.stat().st_size / 1e6


def _costs(problem: Problem) -> Point:
    c = problem.start(_BATCH, torch.Generator().manual_seed(0), 0.3)
    body, family = problem.body, problem.trajectory
    works = {
        "gram_ms": lambda: gram(body, family, c, problem.samples),
        "gradient_ms": lambda: value_and_gradient(problem, c, Penalty(30.0)),
        "validity_ms": lambda: check(problem.constraints, family, c),
    }
    runs = medians(_REPEATS, *works.values())
    return {name: 1e3 * run.cpu / len(c) for name, run in zip(works, runs)}


def chain(arm: Arm, count: int) -> Arm:
    """A chain of so many joints: the arm's own, from the base outwards, over and over."""
    own = torch.arange(count) % arm.joints
    names = tuple(f"{arm.joint_names[k]}_{i}" for i, k in enumerate(own.tolist()))
    of_joints = """
        prismatic rotation translation axis inertial_parameters position_lower position_upper velocity_limit
        torque_limit
    """
    first = [int((arm.capsules.link == k).nonzero()[0]) for k in own.tolist()]
    ends = {name: getattr(arm.capsules, name)[first] for name in ("a", "b", "radius")}
    capsules = replace(arm.capsules, link=torch.arange(count), names=names, **ends)
    numbers = {name: getattr(arm, name)[own] for name in of_joints.split()}
    return replace(arm, joint_names=names, capsules=capsules, **numbers)


@contextmanager
def _clock(spent: Counter[str], name: str) -> Iterator[None]:
    """Add the CPU time of the block [s]."""
    began = time.process_time()
    yield
    spent[name] += time.process_time() - began  # type: ignore[assignment] # seconds


def _peak() -> float:
    """Largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
