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
from sidegan.dynamics import gram
from sidegan.excitation import Excitation, excite
from sidegan.identification import Measurements, identify
from sidegan.library import Library
from sidegan.library.stream import Diagonals, save_parts, take
from sidegan.robot import Arm
from sidegan.seeds.gradient import Gradient
from sidegan.seeds.objective import Penalty, value_and_gradient
from sidegan.seeds.problem import SeedProblem
from sidegan.selection import greedy_in_parts
from sidegan.trajectory import Trajectory
from sidegan.validity import Constraints, Plane, Validity, check

Point = dict[str, float]

_REPEATS = 3
_BATCH = 50
_PART = 2_000  # trajectories of a library in memory at a time
_PICKS = 35
_STEPS = 200  # of every optimisation
_DESK = Plane((0.0, 0.0, 1.0), 0.10)


def warm_up() -> None:
    """Load the compiled kernels, which no point should pay for."""
    problem = Setting().problem
    Gradient(steps=2, attempts=1).optimise(problem, 1, np.random.SeedSequence(0))
    excite(problem.body, problem.trajectory, problem.start(1, torch.Generator()))


def joints(count: int) -> Point:
    """Cost per trajectory [ms] of YᵀY, its gradient with the penalty, and the check of validity."""
    return _costs(SeedProblem(Constraints(_repeated(Setting().arm, count), [_DESK]), Trajectory(count)))


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
    """Seconds of every step from noise to the selection, in parts, and the peak of memory [MB]."""
    setting = Setting()
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
            yield _library(setting, c, verdict, found)

    with TemporaryDirectory() as folder:
        path = Path(folder) / "library.parquet"
        whole = timed(lambda: save_parts(path, parts())).wall
        clock.spent["write"] = whole - sum(clock.spent.values())
        with clock("selection"):
            picked = greedy_in_parts(Diagonals(path), min(_PICKS, count))
        with clock("read"):
            take(path, picked)
        size = path.stat().st_size / 1e6
    return {
        **{f"{name}_s": spent for name, spent in clock.spent.items()},
        "file_mb": size,
        "peak_mb": _peak(),
    }


def rls(count: int) -> Point:
    """Seconds to identify from so many trajectories of 1600 samples, and the peak of memory [MB]."""
    setting = Setting()
    c, times = setting.start(10), setting.trajectory.grid(1600)
    motion = setting.trajectory.roll_out(c, times)
    torque = setting.body.torque(*motion[1:])
    known = [Measurements(*parts) for parts in zip(*motion[1:], torque)]
    run = timed(lambda: identify(setting.body, (known[k % len(known)] for k in range(count))))
    return {"wall_s": run.wall, "cpu_s": run.cpu, "peak_mb": _peak()}


def long(periods: int) -> Point:
    """One trajectory of so many periods of 16 s with their bandwidth, beside so many short ones.

    ``differences`` is what an optimiser without gradients pays to do what ours does in a step: one
    evaluation per coefficient; times the coefficients again, as steps grow with them, it is the paper's
    cubic cost.
    """
    short = Setting().problem
    family = Trajectory(7, 6 * periods, 16.0 * periods)
    problem = replace(short, trajectory=family, samples=short.samples * periods)
    c = problem.start(1, torch.Generator().manual_seed(0), 0.3)
    value, slope = medians(
        _REPEATS, lambda: problem.fitness(c), lambda: value_and_gradient(problem, c, Penalty(30.0))
    )
    one = Gradient(steps=_STEPS).optimise(problem, 1, np.random.SeedSequence(0))
    many = Gradient(steps=_STEPS).optimise(short, periods, np.random.SeedSequence(0))
    coefficients = c.numel()
    return {
        "coefficients": coefficients,
        "evaluation_ms": 1e3 * value.cpu,
        "gradient_ms": 1e3 * slope.cpu,
        "differences_ms": 1e3 * value.cpu * coefficients,
        "without_gradients_s": value.cpu * coefficients**2,
        "one_long_cpu_s": one.cpu_seconds,
        "many_short_cpu_s": many.cpu_seconds,
        "one_long_valid": len(one),
        "many_short_valid": len(many),
        "one_long_condition": float(one.fitness.min()) if len(one) else float("nan"),
        "many_short_condition": float(many.fitness.median()) if len(many) else float("nan"),
    }


def _costs(problem: SeedProblem) -> Point:
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


def _library(setting: Setting, c: Tensor, verdict: Validity, found: Excitation) -> Library:
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
    """Wall time by the name of what was done [s]."""

    def __init__(self) -> None:
        self.spent: dict[str, float] = {}

    @contextmanager
    def __call__(self, name: str) -> Iterator[None]:
        began = time.perf_counter()
        yield
        self.spent[name] = self.spent.get(name, 0.0) + time.perf_counter() - began


def _peak() -> float:
    """Largest memory of this process so far [MB]."""
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e3
