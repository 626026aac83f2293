"""Stage worth: excitation sets of every contender, and how well plants in MuJoCo are identified from them."""

import logging
import time
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from sidegan.base.parallel import Job, Report, cores, run_jobs
from sidegan.base.progress import duration
from sidegan.base.storage import read_torch, readable, write_json, write_parquet, write_task, write_torch
from sidegan.identification import TorqueModel
from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import REPORT, RESULTS, Task
from sidegan.pipeline.workspace import Workspace
from sidegan.plant.friction import Form
from sidegan.plant.varied import VariedPlant
from sidegan.report.tables import arrow
from sidegan.robot import require_consistent
from sidegan.validity import Constraints
from sidegan.worth import Judge, Regime, SetOf, Truth, legs, make_set
from sidegan.worth.contenders import Order
from sidegan.worth.cost import Cost, cost, pace
from sidegan.worth.curves import Curves, mean_error

log = logging.getLogger(__name__)

SETS = "sets.pt"
JUDGED, OTHERS = "", "others"  # groups of regimes
_STUDY = ("plants", "sets", "horizon", "plant", "sensors", "model", "believed", "tasks")
_TRUTH = ("plants", "plant", "sensors", "model", "tasks", "acceleration")
_DESIGN = ("sets", "plant", "model", "believed", "design_tasks", "misfits", "search")


def arms(task: Task) -> dict[str, Task]:
    """The run's own arm and the others of the study whose descriptions are there, by name."""
    found = {task.arm.name: task}
    for name, path in task.cfg.worth.others.items():
        if not Path(path).expanduser().is_file():
            log.warning("worth.others.%s: there is no %s; the study goes without this arm", name, path)
            continue
        robot = replace(task.cfg.robot, name=path)
        free = Workspace(torque=task.cfg.workspace.torque, regions=[])
        found[name] = task.with_settings(robot=robot, workspace=free)
    return found


def constraints(task: Task) -> Constraints:
    """The arm in its workspace, with a limit of acceleration where it states none."""
    arm, workspace = task.arm, task.cfg.workspace
    if arm.acceleration_limit is None:
        limit = task.cfg.worth.acceleration * arm.velocity_limit
        arm = replace(arm, acceleration_limit=limit)
    return Constraints(arm, workspace.shapes(arm), workspace.torque, workspace.clearance)


def sets(task: Task, name: str) -> Artifact:
    """The excitation sets of one contender."""
    settings = task.cfg.worth
    one = settings.contenders[name]
    own = {key: asdict(settings)[key] for key in _DESIGN}
    own |= {"count": settings.count(one), "contender": asdict(one), "acceleration": settings.acceleration}
    for shown in ("title", "practice"):
        own["contender"].pop(shown)
    make = partial(_make_sets, name=name)
    return task.artifact("worth_set", name, make, own, title=f"worth_set/{name}")


def worth(task: Task, name: str, group: str = JUDGED) -> Artifact:
    """Errors of the plants that are identified from them, as robots move on, in the regimes of a group."""
    own = {key: asdict(task.cfg.worth)[key] for key in _STUDY} | _stamped(task, group)
    inputs = {"worth_set": sets(task, name), "worth_truth": truths(task, group)}
    make, title = partial(_make, name=name, group=group), "/".join(filter(None, ("worth", name, group)))
    label = "-".join(filter(None, (name, group)))
    return task.artifact("worth", label, make, own, inputs, title=title, alone=True)


def truths(task: Task, group: str = JUDGED) -> Artifact:
    """The plants on the tasks, without noise: what models of them are judged by."""
    own = {key: asdict(task.cfg.worth)[key] for key in _TRUTH} | _stamped(task, group)
    label = "-".join(filter(None, ("truth", group)))
    return task.artifact("worth_truth", label, partial(_make_truths, group=group), own, alone=True)


def groups(task: Task) -> dict[str, dict[str, Regime]]:
    """Regimes that are judged, and the others where there are any: artifacts of their own."""
    settings = task.cfg.worth
    parts = {JUDGED: True, OTHERS: False}
    found = {
        group: {name: one for name, one in settings.regimes.items() if (name in settings.judged) == judged}
        for group, judged in parts.items()
    }
    return {group: regimes for group, regimes in found.items() if regimes}


def _stamped(task: Task, group: str) -> dict[str, object]:
    return {"regimes": {name: asdict(one) for name, one in groups(task)[group].items()}}


def load(task: Task, name: str) -> list[SetOf]:
    """A contender's sets, which must be there."""
    content = read_torch(task.store.require(sets(task, name)) / SETS)
    families = [Trajectory(**one) for one in content["families"]]
    return [SetOf(family, c) for family, c in zip(families, content["coefficients"])]


def _make_sets(task: Task, build: Build, name: str) -> None:
    settings, place = task.cfg.worth, constraints(task)
    one = settings.contenders[name]
    home = tuple(task.trajectory.home or ())
    seeds = task.random(f"worth {name}").spawn(settings.sets)
    made = []
    for number, seed in enumerate(seeds):
        path = build.work / f"{number}.pt"
        if not readable(path):
            began_one = time.process_time()
            found = make_set(Order(place, home, settings, one, settings.count(one), seed))
            took = time.process_time() - began_one
            content = {"family": found.family.describe(), "coefficients": found.coefficients, "seconds": took}
            write_task(path, content)
        made.append(read_torch(path))
        build.report(number + 1, settings.sets)
    costs = [x["seconds"] for x in made]  # those of sets that a stopped run left too
    build.costs.update(cpu_seconds=float(np.sum(costs)), cpu_seconds_per_set=float(np.mean(costs)))
    families, coefficients = ([x[key] for x in made] for key in ("family", "coefficients"))
    write_torch(build.folder / SETS, {"families": families, "coefficients": coefficients})
    seconds = [len(c) * f["period"] for f, c in zip(families, coefficients)]
    write_json(build.folder / REPORT, {"sets": len(made), "seconds": float(np.mean(seconds))})


def _make_truths(task: Task, build: Build, group: str) -> None:
    count = task.cfg.worth.plants
    jobs: list[Job] = [partial(_truth, task, group, k, build.work / f"{k}.pt") for k in range(count)]
    run_jobs("worth: plants (%)", jobs, task.cfg.parallel.workers)
    for k in range(count):
        write_torch(build.folder / f"{k}.pt", read_torch(build.work / f"{k}.pt"))


def _make(task: Task, build: Build, name: str, group: str) -> None:
    count = task.cfg.worth.plants
    jobs: list[Job] = [partial(_judge, task, name, group, k, build.work / f"{k}.pt") for k in range(count)]
    frames = run_jobs(f"worth: {name} (%)", jobs, task.cfg.parallel.workers)
    frame = pd.concat(frames, ignore_index=True)
    write_parquet(build.folder / RESULTS, arrow(frame))
    last = frame[frame.time == frame.time.max()].groupby("regime").error.median()
    write_json(build.folder / REPORT, {f"error_{regime}": float(x) for regime, x in last.items()})


def _judge(task: Task, name: str, group: str, number: int, path: Path, report: Report) -> pd.DataFrame:
    """Curves of one plant in all regimes: a row per set, regime and time."""
    if not readable(path):
        settings, place = task.cfg.worth, constraints(task)
        judge = Judge(settings, TorqueModel(place.body, settings.model))
        known = read_torch(task.store.require(truths(task, group)) / f"{number}.pt")
        made, seed, rows = load(task, name), task.number(f"worth {name} {number}"), []
        for done, (form, regimes) in enumerate(_by_form(task, group).items()):
            truth = Truth(*known[form])
            curves = judge.curves(_plant(task, place, form, number), made, truth, regimes, seed)
            key = {"plant": number, "floor": float(truth.floor())}
            for regime, found in curves.items():
                rows += _rows(judge, found, {**key, "regime": regime})
            report(done + 1, len(known))
        write_task(path, pd.DataFrame(rows).to_dict("list"))
    return pd.DataFrame(read_torch(path))


def _truth(task: Task, group: str, number: int, path: Path, report: Report) -> None:
    """One plant on the tasks, with each form of friction."""
    if not readable(path):
        settings, place = task.cfg.worth, constraints(task)
        judge, moves = Judge(settings, TorqueModel(place.body, settings.model)), _tasks(task, place)
        forms = _by_form(task, group)
        found = {form: tuple(judge.truth(_plant(task, place, form, number), moves)) for form in forms}
        write_task(path, found)
    report(1, 1)


def _plant(task: Task, place: Constraints, form: Form, number: int) -> VariedPlant:
    """One of the plants; with another form of friction it is the same in all else."""
    settings = task.cfg.worth
    seed = task.random("worth plants").spawn(number + 1)[number]
    return VariedPlant(place.arm, settings.plant, form, seed)


def _by_form(task: Task, group: str) -> dict[Form, dict[str, Regime]]:
    """The regimes, by the form of friction whose execution they share."""
    forms: dict[Form, dict[str, Regime]] = {}
    for regime, one in groups(task)[group].items():
        forms.setdefault(one.form, {})[regime] = one
    return forms


def _rows(judge: Judge, found: Curves, key: dict[str, object]) -> list[dict[str, object]]:
    """A row per set and time."""
    mean = mean_error(found.errors)
    return [
        {**key, "set": k, "time": float(t), "error": float(mean[k, i]), "covered": float(found.covered[k])}
        for k in range(len(mean))
        for i, t in enumerate(judge.times)
    ]


def _tasks(task: Task, place: Constraints) -> list[Motion]:
    """The tasks, which no set was made for, at the plants' rate."""
    generator = torch.Generator().manual_seed(task.number("worth tasks"))
    kinds = task.cfg.worth.tasks.values()
    return [move for one in kinds for move in legs(place, one, task.cfg.worth.plant.rate, generator)]


def _artifacts(task: Task) -> list[Artifact]:
    """Of each arm: its plants, then every contender's sets and what came of them."""
    names = list(task.cfg.worth.contenders)
    return [
        x
        for one in arms(task).values()
        for x in (
            *(truths(one, group) for group in groups(one)),
            *(sets(one, name) for name in names),
            *(worth(one, name, group) for name in names for group in groups(one)),
        )
    ]


def _check(task: Task) -> None:
    """Refuse arms that MuJoCo would, and say what is left to be made takes."""
    require_consistent(task.arm)
    if "worth" in task.cfg.stages and any(task.store.find(one) is None for one in _artifacts(task)):
        told = [expected(one) for one in arms(task).values()]
        total, workers = sum(x.total for x in told), cores(task.cfg.parallel.workers)
        log.info(
            "the whole study takes some %s of CPU time, %s of it design: %s on %d idle cores; "
            "a second start goes on from what is made",
            *(duration(x) for x in (total, sum(one.design for one in told), total / workers)),
            workers,
        )


def expected(task: Task) -> Cost:
    """What the study of a task's arm takes, from the pace of a few of its parts."""
    settings, place = task.cfg.worth, constraints(task)
    name = next(x for x, one in settings.contenders.items() if not one.bad)
    one, seed = settings.contenders[name], np.random.SeedSequence(0)
    order = Order(place, tuple(task.trajectory.home or ()), settings, one, 1, seed)
    judge = Judge(settings, TorqueModel(place.body, settings.model))
    return cost(settings, pace(judge, _plant(task, place, "eyring", 0), order))


STAGE = Stage(_artifacts, check=_check)
