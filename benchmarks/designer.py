"""Benchmarks of the designer on one thread, in CPU time, over situations that nobody has seen."""

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path
from typing import Any

import numpy as np
import torch
import yaml

from benchmarks.setting import DESK, Setting
from benchmarks.situations import MIXES, Draw
from benchmarks.timing import Result, Timing, medians
from sidegan.base.typed import build
from sidegan.design.excitation import excite
from sidegan.design.information import information_of
from sidegan.design.objective import value_and_gradient
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.designer import (
    Aim,
    Design,
    Designer,
    DesignerSettings,
    Generator,
    GeneratorSettings,
    Situation,
    Starts,
    make_generator,
    make_starts,
)
from sidegan.designer.descent import Penalties
from sidegan.validity import Box, Constraints, Plane, Region

_CONF = Path(__file__).resolve().parents[1] / "conf"
_COUNT = 200
_QUICK_GENERATOR = {"modes": 3, "width": 16, "situations": 8, "steps": 10, "batch": 8}
_QUICK_LIBRARY = {"count": 6, "steps": 40}
_MANY: list[Region] = [
    Box((0.4, 0.2, 0.3), (0.6, 0.5, 0.7)),
    Plane((1.0, 0.0, 0.0), -0.8),
    Plane((0.0, 1.0, 0.0), -0.8),
]
_NOISE = 0.01  # of torque limits
_NEXT = 40  # trajectories after which the next one is designed
_QUICK_EVALUATIONS = 60  # in place of a deadline, which a slow machine would not answer by


@dataclass(frozen=True)
class Bench:
    """The designer and what it is asked."""

    setting: Setting

    @cached_property
    def settings(self) -> DesignerSettings:
        """As configured."""
        settings = build(DesignerSettings, _yaml("designer/default"))
        if not self.setting.quick:
            return settings
        return replace(settings, library=replace(settings.library, **_QUICK_LIBRARY))

    @cached_property
    def starts(self) -> Starts:
        """The library, made anew."""
        problem = self.setting.problem
        seed = np.random.SeedSequence(0)
        return make_starts(problem.constraints, problem.trajectory, self.settings, seed)

    @property
    def size(self) -> int:
        """Bytes of the library's file."""
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "starts.pt"
            self.starts.save(path, self.designer().numbers)
            return path.stat().st_size

    @cached_property
    def generator(self) -> Generator:
        """The generator of starts, made anew."""
        settings = build(GeneratorSettings, _yaml("generator/default"))
        settings = replace(settings, **_QUICK_GENERATOR) if self.setting.quick else settings
        problem, seed = self.setting.problem, np.random.SeedSequence(0)
        return make_generator(problem.constraints, problem.trajectory, self.settings, settings, seed)

    def designer(self, starts: bool = True, generator: bool = False) -> Designer:
        """A designer that reads the CPU's clock, with the library, the generator, or from random points."""
        problem = self.setting.problem
        begin = self.generator if generator else self.starts if starts else None
        return Designer(
            problem.constraints, problem.trajectory, self.settings, begin, clock=time.process_time
        )

    @cached_property
    def situations(self) -> list[Situation]:
        """Feasible situations of every mix."""
        each = max(1, self.setting.size(_COUNT) // len(MIXES))
        return Draw(self.setting.problem, 999).mixed(each)

    def condition(self, design: Design) -> float:
        """Condition number of an answer; infinite where there is none."""
        if design.coefficients is None:
            return float("inf")
        body = self.setting.problem.body
        return float(excite(body, design.trajectory, design.coefficients[None], 100).eigenvalue_fitness[0])


benches: dict[Setting, Bench] = {}


def _bench(setting: Setting) -> Bench:
    return benches.setdefault(setting, Bench(setting))


def _yaml(name: str) -> dict[str, Any]:
    return yaml.safe_load((_CONF / f"{name}.yaml").read_text(encoding="utf-8"))


def _milliseconds(seconds: float) -> float:
    return 1e3 * seconds


def design_evaluation(setting: Setting) -> Result:
    """Milliseconds of an evaluation with gradient among a box, walls and desk, beside the batch's code."""
    designer, count = _bench(setting).designer(starts=False), setting.size(400)
    scene = designer.numbers.scene(Situation(regions=_MANY))
    descent = designer.descents.descent(scene, Aim(), _penalties(designer))
    x = np.random.default_rng(0).standard_normal(scene.size.shape)
    descent.place(x * 0.3)
    arm, family = setting.problem.constraints.arm, setting.problem.trajectory
    problem = Problem(Constraints(arm, [DESK, *_MANY]), family, designer.settings.samples)
    c, few = setting.start(1), setting.size(20)
    run, theirs = medians(
        setting.repeats,
        lambda: descent.run(count),
        lambda: [value_and_gradient(problem, c, Penalty(300.0)) for _ in range(few)],
    )
    each = Timing(run.cpu / count, run.cpu / count)
    return Result(each, 1e3, _milliseconds(theirs.cpu / few))


def _penalties(designer: Designer) -> Penalties:
    settings = designer.settings
    return Penalties(300.0, settings.reserve, settings.reserve, settings.clearance)


def design_setup(setting: Setting) -> Result:
    """Milliseconds until a search can begin in a new situation, beside what every other room needs for it."""
    designer, count = _bench(setting).designer(starts=False), setting.size(200)
    situation, penalties = Situation([0.1] * 7, _MANY, 0.7, 0.8, 12.0), _penalties(designer)
    arm = setting.problem.constraints.arm

    def begin() -> None:
        for _ in range(count):
            scene = designer.numbers.scene(situation)
            designer.descents.descent(scene, Aim(), penalties)
            designer.prover.prove(scene, np.zeros_like(scene.size))

    run, theirs = medians(setting.repeats, begin, lambda: Constraints(arm, [DESK, *_MANY]))
    each = Timing(run.cpu / count, run.cpu / count)
    return Result(each, 1e3, _milliseconds(theirs.cpu))


def _within(setting: Setting, deadline: float, quantile: float) -> Result:
    """A quantile of cond(YᵀY) over the situations when the deadline has come, beside searches from chance."""
    bench = _bench(setting)
    ours, theirs = bench.designer(), bench.designer(starts=False)
    for designer in (ours, theirs):
        designer.ask(bench.situations[0], evaluations=20)
    answers = [ours.ask(situation, deadline=deadline) for situation in bench.situations]
    others = [theirs.ask(situation, deadline=deadline) for situation in bench.situations]
    numbers, random = ([bench.condition(x) for x in some] for some in (answers, others))
    library = [bench.condition(_unpolished(ours, situation)) for situation in bench.situations]
    spent = [1e3 * x.spent.seconds for x in answers]
    also: dict[str, float | str] = {
        "nearest of the library, not polished": _quantile(library, quantile),
        "share without an answer [%]": 100 * float(np.mean(np.isinf(numbers))),
        "median CPU time [ms]": float(np.median(spent)),
        "longest CPU time [ms]": max(spent),
        "median number of evaluations": float(np.median([x.spent.evaluations for x in answers])),
    }
    also |= {f"quantile {q:g}": _quantile(numbers, q) for q in (0.1, 0.5, 0.9)}
    return Result(Timing(1.0, 1.0), _quantile(numbers, quantile), _quantile(random, quantile), also)


def _quantile(numbers: Sequence[float], quantile: float) -> float:
    """A quantile that is a number of the sample, with 10¹² for an infinite one, as JSON knows none."""
    found = float(np.quantile(numbers, quantile, method="lower"))
    return min(found, 1e12)


def _unpolished(designer: Designer, situation: Situation) -> Design:
    """The nearest start as it is, or smaller until it is proven."""
    return designer.ask(situation, evaluations=1)


def design_8ms(setting: Setting) -> Result:
    """Median of cond(YᵀY) after 8 ms."""
    return _within(setting, 0.008, 0.5)


def design_12ms(setting: Setting) -> Result:
    """Median of cond(YᵀY) after 12 ms."""
    return _within(setting, 0.012, 0.5)


def design_50ms_worst(setting: Setting) -> Result:
    """0.9 quantile of cond(YᵀY) after 50 ms."""
    return _within(setting, 0.05, 0.9)


def design_next(setting: Setting) -> Result:
    """Median gain of log det in 12 ms by one further trajectory, beside searches from chance."""
    bench = _bench(setting)
    problem = setting.problem
    noise = (_NOISE * problem.constraints.arm.torque_limit).tolist()
    gains: dict[str, list[float]] = {"ours": [], "chance": [], "condition": []}
    designers = {
        "ours": bench.designer(),
        "chance": bench.designer(starts=False),
        "condition": bench.designer(),
    }
    for designer in designers.values():
        designer.ask(aim=Aim("determinant", noise=noise), evaluations=20)
    limit: dict[str, Any] = {"evaluations": _QUICK_EVALUATIONS} if setting.quick else {"deadline": 0.012}
    for c in _recorded(setting):
        prior = _information(setting, c, noise, bench.settings.rate)
        for name, designer in designers.items():
            aim = Aim() if name == "condition" else Aim("determinant", prior, noise)
            design = designer.ask(aim=aim, **limit)
            more = 0 * prior
            if design.coefficients is not None:
                more = _information(setting, design.coefficients[None], noise, bench.settings.rate)
            gains[name].append(float(np.linalg.slogdet(prior + more)[1] - np.linalg.slogdet(prior)[1]))
    also: dict[str, float | str] = {
        "made for the condition number alone": float(np.median(gains["condition"])),
        "worst": min(gains["ours"]),
    }
    return Result(Timing(1.0, 1.0), float(np.median(gains["ours"])), float(np.median(gains["chance"])), also)


def _recorded(setting: Setting) -> list[torch.Tensor]:
    """One random trajectory each that was recorded already, (1, J, H, 2)."""
    return list(setting.start(setting.size(_NEXT)).split(1))


def _information(setting: Setting, c: torch.Tensor, noise: Sequence[float], rate: float) -> np.ndarray:
    """What a trajectory tells that is measured at a rate [Hz], (p, p)."""
    problem = setting.problem
    deviation = torch.tensor(list(noise), dtype=torch.float64)
    each = information_of(problem.body, problem.trajectory, c, deviation=deviation).matrices(slice(None))[0]
    return each.numpy() * rate * problem.trajectory.period
