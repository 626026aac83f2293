"""Stages random and long: random and searched trajectories; long ones, and short ones by their optimiser."""

from contextlib import suppress
from dataclasses import asdict, replace
from functools import partial
from time import process_time
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.storage import write_json
from sidegan.design.beside import compile_beside
from sidegan.design.objective import Goal
from sidegan.design.prediction import Prediction, TorqueNoise, wanted_torques
from sidegan.design.problem import Coordinates, Problem, SearchSettings
from sidegan.design.search import search
from sidegan.errors import InfeasibleError
from sidegan.library import LIBRARY
from sidegan.library.draw import Draws, Expansion, draw_valid
from sidegan.library.measure import library_of
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import REPORT, RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.stages.seeds import make, save_set
from sidegan.seeding import Gradient, make_long, seeds_recipe

REACH = 0.8  # share of its tightest joint limit that a random trajectory uses
_TRIES = 1000  # most draws per random trajectory
_DRAWN, _VALID, _BISECTIONS = 400, 0.99, 12  # natural draws, their share to be valid, steps to find the reach
_SEARCHED = 200  # trajectories of each search
SEARCH, BOXED, _EVALUATIONS = "search-", "boxed-", (10, 40, 160)
GRADIENT = "gradient"  # optimiser of the single long trajectory, and of short ones to compare
_CHOICE = 5  # number of short ones for each that is picked


def random_set(run: RunContext) -> Artifact:
    """Random valid trajectories, as many as in a generator's library."""
    settings = {"count": run.cfg.library.count}
    return run.artifact("random", "random", _make_random, settings, title="random", alone=True)


def _make_random(run: RunContext, build: Build) -> None:
    count = run.cfg.library.count
    draws = random_valid(run, count, "random set")
    facts = {"drawn": draws.drawn, "valid_share": count / draws.drawn}
    save_set(run, build, draws.coefficients, "random", facts)


def random_valid(run: RunContext, count: int, purpose: str, reach: float = REACH) -> Draws:
    """Random valid trajectories, (count, J, H, 2), from the run's random numbers for a purpose."""
    generator = np.random.default_rng(run.number(purpose))
    settings = Expansion(count=count, batch=count, draws=_TRIES * count, least=count)
    problem, drawn = run.cell.problem, "drawn at random in this workspace"
    return draw_valid(lambda n: problem.start(n, generator, reach), run.cell.check, settings, drawn)


def test_trajectories(run: RunContext) -> Array:
    """Random test trajectories, (tests, J, H, 2), that are in no excitation set."""
    settings = run.cfg.identification
    return random_valid(run, settings.tests, "tests", settings.reach).coefficients


def prediction(run: RunContext, noise: TorqueNoise, family: Trajectory | None = None) -> Prediction:
    """Expected errors on the test trajectories; the excitation is of ``family``, by default the short one."""
    settings, body, short = run.cfg.identification, run.cell.body, run.cell.trajectory
    wanted = wanted_torques(body, short, test_trajectories(run), short.times(settings.rate))
    return Prediction.at_rate(body, family or short, wanted, noise, settings.rate, settings.prior)


def predicted(run: RunContext) -> dict[str, Any]:
    """Settings that expected errors under constant noise depend on."""
    study = run.cfg.identification
    return {key: getattr(study, key) for key in ("rate", "prior", "constant", "tests", "reach")}


def natural_set(run: RunContext) -> Artifact:
    """Random draws in natural coordinates, at the largest reach at which nearly all are valid."""
    settings = {"drawn": _DRAWN, "valid": _VALID}
    return run.artifact("baseline", "natural", _make_natural, settings, title="natural")


def _make_natural(run: RunContext, build: Build) -> None:
    problem = run.cell.problem
    random = np.random.default_rng(run.number("natural"))
    natural = Coordinates.of(problem)
    whole = natural.coefficients(natural.start(problem, _DRAWN, random, 1.0))
    reach, above = 0.0, 1.0
    for _ in range(_BISECTIONS):
        middle = (reach + above) / 2
        if run.cell.check(middle * whole).valid.mean() >= _VALID:
            reach = middle
        else:
            above = middle
    c = reach * whole
    valid = run.cell.check(c).valid
    save_set(run, build, c[valid], "natural", {"reach": reach, "valid_share": float(valid.mean())})


def searched_sets(run: RunContext) -> dict[str, Artifact]:
    """Trajectories that a search finds, by name, which ends with the evaluations for each.

    "search": for a small condition number, within the arm's limits; "boxed": for prediction, and also within
    the box of the seeds, if they have one.
    """
    made = {}
    for kind in (SEARCH,) if run.cfg.seeds.box is None else (SEARCH, BOXED):
        for evaluations in _EVALUATIONS:
            name, chosen = f"{kind}{evaluations}", SearchSettings(evaluations=evaluations)
            settings = {"count": _SEARCHED, **asdict(chosen)}
            if kind == BOXED:
                settings |= {**predicted(run), "box": run.cfg.seeds.box}
            make = partial(_make_searched, name=name, settings=chosen)
            made[name] = run.artifact("baseline", name, make, settings, title=name)
    return made


def _make_searched(run: RunContext, build: Build, name: str, settings: SearchSettings) -> None:
    problem, goal = run.cell.problem, Goal()
    if name.startswith(BOXED):
        problem = replace(problem, box=run.cfg.seeds.box)
        goal = prediction(run, TorqueNoise.constant(run.cell.body, run.cfg.identification.constant)).goal
    found = []
    first = run.number("search")
    with suppress(InfeasibleError):
        search(problem, goal, settings, first)  # compiles kernels, which is not a cost of searching
    began = process_time()
    for k in range(_SEARCHED):
        try:
            found.append(search(problem, goal, settings, first + k).coefficients)
        except InfeasibleError:
            if k + 1 == _SEARCHED and not found:
                raise
        build.report(k + 1, _SEARCHED)
    build.costs["cpu_each"] = (process_time() - began) / _SEARCHED
    save_set(run, build, np.stack(found), name, {"valid_share": len(found) / _SEARCHED})


def baselines(run: RunContext) -> dict[str, Artifact]:
    """Sets that generators are compared with, by name."""
    return {"random": random_set(run), "natural": natural_set(run), **searched_sets(run)}


def long_family(run: RunContext, harmonics: int) -> Trajectory:
    """The family of the single long trajectory."""
    return Trajectory(run.cell.arm.joints, harmonics, run.cfg.long.period, run.cell.trajectory.home)


def long_trajectory(run: RunContext, harmonics: int) -> Artifact:
    """The best single long trajectory with a number of harmonics, optimised by gradients."""
    chosen = run.cfg.long
    settings = asdict(chosen) | {"harmonics": harmonics}
    settings |= {"fitness": "eigenvalue", "reserve": run.cfg.seeds.reserve}
    label = f"{chosen.steps}-{chosen.period:g}s-{harmonics}h"
    make = partial(_make_long, harmonics=harmonics)
    return run.artifact("long", label, make, settings, title=f"long/{harmonics}", alone=True)


def _make_long(run: RunContext, build: Build, harmonics: int) -> None:
    settings = run.cfg.long
    family = long_family(run, harmonics)
    problem = Problem(run.cell.constraints, family, settings.samples)
    method = Gradient(settings.steps, attempts=1, reserve=run.cfg.seeds.reserve or 0.0)
    random, workers = run.random(f"long {harmonics}"), run.cfg.parallel.workers
    made = make_long(problem, method, settings.starts, random, workers)
    library = library_of(run.cell.constraints, family, made.coefficients, f"long-{harmonics}")
    library.save(build.folder / LIBRARY)
    build.costs["cpu_seconds"] = made.cpu_seconds
    report = {"condition": float(library.fitness[0]), "starts": made.attempts, "evaluations": settings.steps}
    write_json(build.folder / REPORT, report)


def gradient_set(run: RunContext) -> Artifact:
    """Short trajectories by the optimiser of the single long one, to pick a set from."""
    method = seeds_recipe(GRADIENT, count=_CHOICE * run.cfg.selection.count)
    other = run.with_settings(seeds=method)
    return other.artifact("short", GRADIENT, make, method.stamped(), title="short", alone=True)


def _long(run: RunContext) -> list[Artifact]:
    made = [long_trajectory(run, h) for h in run.cfg.long.harmonics]
    return made if run.cfg.seeds.method == GRADIENT else [*made, gradient_set(run)]


def _compile_searches(run: RunContext) -> None:
    """Start compiling what missing searches need, while other stages run."""
    if any(run.store.find(made) is None for made in searched_sets(run).values()):
        compile_beside()


STAGES = {
    "random": Stage(lambda run: baselines(run).values(), check=_compile_searches),
    "long": Stage(_long),
}
