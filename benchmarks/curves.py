"""The points of the growth curves: what one costs, as plain numbers; each runs in a process of its own."""

import resource
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import torch
from torch import Tensor

from benchmarks.networks import untrained
from benchmarks.setting import Setting
from benchmarks.timing import Timing, medians, timed
from sidegan.design.excitation import Excitation, excite
from sidegan.design.greedy import greedy_in_parts
from sidegan.design.objective import Penalty, value_and_gradient
from sidegan.design.problem import Problem
from sidegan.identification import RIGID, Measurements, TorqueModel
from sidegan.identification.gather import gather
from sidegan.library import Library
from sidegan.library.stream import Diagonals, save_parts, take
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.seeds.gradient import Gradient
from sidegan.validity import Constraints, Plane, Validity, check

Point = dict[str, float]

_REPEATS = 5  # in one process
_BATCH = 50
_PART = 2_000  # trajectories of a library in memory at a time
_PICKS = 35
_STEPS = 200  # of every optimisation
_SAMPLES = 1600  # per trajectory that is identified from
_DESK = Plane((0.0, 0.0, 1.0), 0.10)


def warm_up() -> None:
    """Load the compiled kernels, which no point should pay for."""
    problem = Setting().problem
    Gradient(steps=2, attempts=1).optimise(problem, 1, np.random.SeedSequence(0))
    excite(problem.body, problem.trajectory, problem.start(1, torch.Generator()))


def joints(count: int) -> Point:
    """CPU time per trajectory [ms] of YᵀY, its gradient with the penalty, and the check of validity."""
    return _costs(Problem(Constraints(_repeated(Setting().arm, count), [_DESK]), Trajectory(count)))


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
    made = Gradient(steps=_STEPS).optimise(Setting().problem, count, np.random.SeedSequence(0))
    return {
        "cpu_s_per_seed": made.cpu_seconds / max(1, len(made)),
        "condition": float(made.fitness.median()) if len(made) else float("nan"),
    }


def library(count: int) -> Point:
    """CPU time per trajectory [µs] of every step from noise to the selection, and the peak of memory [MB]."""
    setting = Setting()
    _library(setting, _PICKS)  # what is loaded at first use
    spent, whole, size = _library(setting, count)
    return {
        **{f"{name}_us": 1e6 * seconds / count for name, seconds in spent.items()},
        "wall_s": whole,
        "file_mb": size,
        "peak_mb": _peak(),
    }


def rls(count: int) -> Point:
    """CPU time per sample [µs] to identify from so many trajectories of 1600 samples, and peak memory."""
    setting = Setting()
    c, times = setting.start(10), setting.trajectory.grid(_SAMPLES)
    motion = setting.trajectory.roll_out(c, times)
    torque = setting.body.torque(*motion[1:])
    known = [Measurements(*parts) for parts in zip(*motion[1:], torque)]
    model = TorqueModel(setting.body, RIGID)
    gather(model, known[0])
    run = timed(lambda: gather(model, (known[k % len(known)] for k in range(count))))
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
    c = problem.start(1, torch.Generator().manual_seed(0), 0.3)
    works = (
        lambda: problem.fitness(c),
        lambda: value_and_gradient(problem, c, Penalty(30.0)),
        _evaluation(problem),
        _evaluation(short),
    )
    fitness, slope, evaluation, evaluation_short = (run.cpu for run in medians(_REPEATS, *works))
    method, seed = Gradient(steps=_STEPS, attempts=1), np.random.SeedSequence(0)
    found, many = method.optimise(problem, 1, seed), method.optimise(short, periods, seed)
    return {
        "coefficients": c.numel(),
        "fitness_s": fitness,
        "gradient_s": slope,
        "evaluation_s": evaluation,
        "sweep_long_s": 2 * c.numel() * evaluation,
        "sweep_short_s": 2 * c.numel() * evaluation_short,
        "one_long_s": found.cpu_seconds,
        "many_short_s": many.cpu_seconds,
        "one_long_valid": len(found),
        "many_short_valid": len(many),
        "one_long_condition": float(found.fitness.min()) if len(found) else float("nan"),
        "many_short_condition": float(many.fitness.median()) if len(many) else float("nan"),
    }


def _evaluation(problem: Problem) -> Callable[[], object]:
    """One evaluation: the condition number, and every constraint at every sample."""
    c = problem.start(1, torch.Generator().manual_seed(0), 0.3)

    def work() -> None:
        problem.constraints.margins(*(x.flatten(0, 1) for x in problem.motion(c)[1:]))
        problem.fitness(c)

    return work


def _library(setting: Setting, count: int) -> tuple[dict[str, float], float, float]:
    """CPU time of each step [s], wall time of all [s], and size of the file [MB]."""
    generator, noise = untrained(setting), torch.Generator().manual_seed(0)
    clock = _Clock()

    def parts() -> Iterator[Library]:
        for first in range(0, count, _PART):
            with clock("generation"):
                c = generator.sample(min(_PART, count - first), noise)
            with clock("filter"):
                verdict = check(setting.constraints, setting.trajectory, c)
            with clock("excitation"):
                found = excite(setting.body, setting.trajectory, c)
            yield library_of(setting, c, verdict, found)

    began = time.perf_counter()
    with TemporaryDirectory() as folder:
        path = Path(folder) / "library.parquet"
        whole = timed(lambda: save_parts(path, parts())).cpu
        clock.spent["write"] = whole - sum(clock.spent.values())
        with clock("selection"):
            picked = greedy_in_parts(Diagonals(path), min(_PICKS, count))
        with clock("read"):
            take(path, picked)
        size = path.stat().st_size / 1e6
    return clock.spent, time.perf_counter() - began, size


def _costs(problem: Problem) -> Point:
    c = problem.start(_BATCH, torch.Generator().manual_seed(0), 0.3)
    body, family = problem.body, problem.trajectory
    works: dict[str, Callable[[], object]] = {
        "gram": lambda: gram(body, family, c, problem.samples),
        "gradient": lambda: value_and_gradient(problem, c, Penalty(30.0)),
        "validity": lambda: check(problem.constraints, family, c),
    }
    runs: list[Timing] = medians(_REPEATS, *works.values())
    return {f"{name}_ms": 1e3 * run.cpu / len(c) for name, run in zip(works, runs)}


def _repeated(arm: Arm, count: int) -> Arm:
    """A chain of so many joints: the arm's own, from the base outwards, over and over."""
    own = torch.arange(count) % arm.joints
    names = tuple(f"{arm.joint_names[k]}_{i}" for i, k in enumerate(own.tolist()))
    numbers = ("prismatic", "rotation", "translation", "axis", "inertial_parameters", "position_lower")
    more = ("position_upper", "velocity_limit", "torque_limit")
    capsules = arm.capsules
    which = [int((capsules.link == k).nonzero()[0]) for k in own.tolist()]
    links = replace(
        capsules,
        link=torch.arange(count),
        **{name: getattr(capsules, name)[which] for name in ("a", "b", "radius")},
        names=names,
    )
    return replace(
        arm,
        joint_names=names,
        capsules=links,
        **{name: getattr(arm, name)[own] for name in (*numbers, *more)},
    )


def library_of(setting: Setting, c: Tensor, verdict: Validity, found: Excitation) -> Library:
    """A library of coefficients (N, J, H, 2) with all that was measured about them."""
    return Library(
        coefficients=c,
        valid=verdict.valid,
        margins=verdict.margins,
        fitness=found.eigenvalue_fitness,
        diagonal_fitness=found.diagonal_fitness,
        spectrum=found.spectrum,
        diagonal=found.diagonal,
        source=["untrained"] * len(c),
        robot=setting.arm.name,
        digest=setting.arm.digest,
        period=setting.trajectory.period,
        home=tuple(setting.trajectory.home or ()),
    )


class _Clock:
    """CPU time by the name of what was done [s]."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        began = time.process_time()
        yield
        self.spent[name] = self.spent.get(name, 0.0) + time.process_time() - began


def _peak() -> float:
    """Largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
