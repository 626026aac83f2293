"""Stage worth: excitation sets of every contender, and how well plants in MuJoCo are identified from them."""

import logging
import time
from dataclasses import asdict, replace
from functools import cache, partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch

from sidegan.base.parallel import cores
from sidegan.base.progress import duration
from sidegan.base.storage import read_torch, readable, write_json, write_parquet, write_task, write_torch
from sidegan.identification import TorqueModel
from sidegan.motion.trajectory import Motion
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.store import file_digest
from sidegan.pipeline.task import REPORT, RESULTS, Task
from sidegan.pipeline.workspace import Workspace
from sidegan.plant.friction import Form
from sidegan.plant.varied import VariedPlant
from sidegan.report.tables import arrow
from sidegan.robot import require_consistent
from sidegan.validity import Constraints
from sidegan.worth import Contender, Judge, Regime, SetOf, Truth, legs
from sidegan.worth.contenders import BY_DESIGNER, FROM_FILE, make_sets
from sidegan.worth.cost import Cost, cost, pace
from sidegan.worth.curves import Curves, mean_error
from sidegan.worth.estimators import compared
from sidegan.worth.orders import Order, file_of
from sidegan.worth.waypoints import Rests

log = logging.getLogger(__name__)

SETS, TRUTH = "sets.pt", "truth.pt"
OUTLIERS = "outliers"
JUDGED, OTHERS = "", "others"  # groups of regimes
_STUDY = ("sets", "horizon", "plant", "sensors", "model", "believed", "tasks", "acceleration")
_DESIGN = ("sets", "plant", "model", "believed", "design_tasks", "misfits", "search")
_DESIGNER = ("designer", "evaluations", "begun")


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
    return workspace.around(arm, task.cfg.trajectory.home or arm.home)


def contenders(task: Task) -> dict[str, Contender]:
    """Who contends on an arm: those that take their motions from a file only where there is one."""
    every, arm = task.cfg.worth.contenders, task.arm.name
    found = {name: one for name, one in every.items() if not one.files or file_of(one, arm)}
    if missing := [name for name in every if name not in found and arm in (every[name].files or {})]:
        _tell(arm, ", ".join(missing))
    return found


@cache
def _tell(arm: str, missing: str) -> None:
    log.warning("the study of %s goes without %s, whose files are missing", arm, missing)


def sets(task: Task, name: str) -> Artifact:
    """The excitation sets of one contender."""
    settings = task.cfg.worth
    one = settings.contenders[name]
    parts = _DESIGN + _DESIGNER if one.maker in BY_DESIGNER else _DESIGN
    own = {key: asdict(settings)[key] for key in parts}
    own |= {"count": settings.count(one), "contender": asdict(one), "acceleration": settings.acceleration}
    for other in ("title", "practice", "files"):
        own["contender"].pop(other)
    path = file_of(one, task.arm.name)
    inputs = {} if path is None else {"file": file_digest(path)}
    make = partial(_make_sets, name=name)
    return task.artifact("worth_set", name, make, own, inputs, title=f"worth_set/{name}")


def worth(task: Task, number: int, group: str = JUDGED) -> Artifact:
    """One plant on the tasks, and every contender's errors there as robots move on, in a group's regimes."""
    own = {key: asdict(task.cfg.worth)[key] for key in _STUDY}
    own |= {"plant": number, "regimes": {name: asdict(one) for name, one in groups(task)[group].items()}}
    inputs = {name: sets(task, name) for name in contenders(task)}
    label = "-".join(filter(None, (f"plant{number}", group)))
    make = partial(_make, number=number, group=group)
    return task.artifact("worth", label, make, own, inputs, title=f"worth/{label}")


def estimators(task: Task, number: int) -> Artifact:
    """Estimators on one plant, in every judged regime and with outliers."""
    settings = task.cfg.worth
    own = {"outliers": settings.outliers, "estimators": settings.estimators, "estimated": settings.estimated}
    make, title = partial(_make_estimators, number=number), f"worth_estimators/{number}"
    return task.artifact(
        "worth_estimators", f"plant{number}", make, own, {"worth": worth(task, number)}, title=title
    )


def plants(task: Task) -> list[tuple[int, str]]:
    """Plants and groups of regimes that are made of an arm, in the order of their work."""
    settings, made = task.cfg.worth, groups(task)
    return [
        (number, group)
        for number in range(settings.plants)
        for group in made
        if group == JUDGED or number < settings.compared
    ]


def groups(task: Task) -> dict[str, dict[str, Regime]]:
    """Regimes that are judged, and the others where there are any: artifacts of their own."""
    settings = task.cfg.worth
    parts = {JUDGED: True, OTHERS: False}
    found = {
        group: {name: one for name, one in settings.regimes.items() if (name in settings.judged) == judged}
        for group, judged in parts.items()
    }
    return {group: regimes for group, regimes in found.items() if regimes}


def load(task: Task, name: str) -> list[SetOf]:
    """A contender's sets, which must be there."""
    content = read_torch(task.store.require(sets(task, name)) / SETS)
    return [SetOf.of(*one) for one in zip(content["families"], content["coefficients"])]


def _make_sets(task: Task, build: Build, name: str) -> None:
    place, path = constraints(task), build.work / SETS
    if not readable(path):
        began = time.process_time()
        found = make_sets(_orders(task, place, name))
        content = [{"family": x.family.describe(), "coefficients": x.coefficients} for x in found]
        write_task(path, {"sets": content, "seconds": time.process_time() - began})
    content = read_torch(path)
    made, seconds = content["sets"], float(content["seconds"])
    build.costs.update(cpu_seconds=seconds, cpu_seconds_per_set=seconds / len(made))
    families, coefficients = ([x[key] for x in made] for key in ("family", "coefficients"))
    write_torch(build.folder / SETS, {"families": families, "coefficients": coefficients})
    lasting = [len(c) * f["period"] for f, c in zip(families, coefficients)]
    report = {"sets": len(made), "seconds": float(np.mean(lasting))}
    write_json(build.folder / REPORT, report | _violated(place, made))


def _orders(task: Task, place: Constraints, name: str) -> list[Order]:
    """What a contender's sets are made for."""
    settings, home = task.cfg.worth, tuple(task.trajectory.home or ())
    one, seeds = settings.contenders[name], task.random(f"worth {name}").spawn(settings.sets)
    return [Order(place, home, settings, one, settings.count(one), x, k) for k, x in enumerate(seeds)]


def _violated(place: Constraints, made: list[dict[str, Any]]) -> dict[str, float]:
    """Share of the time in which a limit is violated by sets that nobody here made; others never do."""
    every = [SetOf.of(x["family"], x["coefficients"]) for x in made]
    others = [(one.family, one.coefficients) for one in every if isinstance(one.family, Rests)]
    shares = [family.violations(place, points) for family, points in others]
    return {"violated": float(np.mean([max(x.values()) for x in shares]))} if shares else {}


def _make(task: Task, build: Build, number: int, group: str) -> None:
    settings, place, names = task.cfg.worth, constraints(task), list(contenders(task))
    judge, forms = Judge(settings, TorqueModel(place.body, settings.model)), _by_form(task, group)
    path = build.work / "truth.pt"
    if not readable(path):
        moves = _tasks(task, place)
        known = {form: tuple(judge.truth(_plant(task, place, form, number), moves)) for form in forms}
        write_task(path, known)
    write_torch(build.folder / TRUTH, read_torch(path))
    truths = {form: Truth(*x) for form, x in read_torch(path).items()}
    frames = []
    for done, name in enumerate(names):
        path = build.work / f"{name}.pt"
        if not readable(path):
            write_task(path, _rows(task, judge, name, number, group, truths))
        frames.append(pd.DataFrame(read_torch(path)).assign(contender=name))
        build.report(done + 1, len(names))
    frame = pd.concat(frames, ignore_index=True)
    write_parquet(build.folder / RESULTS, arrow(frame))
    last = frame[frame.time == frame.time.max()].groupby(["contender", "regime"]).error.median()
    write_json(build.folder / REPORT, {f"{name}_{regime}": float(x) for (name, regime), x in last.items()})


def _make_estimators(task: Task, build: Build, number: int) -> None:
    settings, place = task.cfg.worth, constraints(task)
    judge = Judge(settings, TorqueModel(place.body, settings.model))
    known = read_torch(task.store.require(worth(task, number)) / TRUTH)
    made = load(task, settings.estimated)[number % settings.sets]
    kinds = {name: (settings.regimes[name], False) for name in settings.judged}
    kinds[OUTLIERS] = next(iter(kinds.values()))[0], True
    rows = []
    for done, (kind, (regime, outliers)) in enumerate(kinds.items()):
        plant, truth = _plant(task, place, regime.form, number), Truth(*known[regime.form])
        seed = task.number(f"worth estimators {number} {kind}")
        found = compared(judge, plant, made, truth, regime, outliers, seed)
        key = {"plant": number, "kind": kind, "floor": float(truth.floor())}
        rows += [{**key, "method": method, **one._asdict()} for method, one in found.items()]
        build.report(done + 1, len(kinds))
    frame = pd.DataFrame(rows)
    write_parquet(build.folder / RESULTS, arrow(frame))
    errors = frame.groupby(["method", "kind"], as_index=False).error.median()
    report = {f"{method}_{kind}": x for method, kind, x in errors.itertuples(index=False)}
    write_json(build.folder / REPORT, report)


def _rows(
    task: Task, judge: Judge, name: str, number: int, group: str, truths: dict[Form, Truth]
) -> dict[str, list[Any]]:
    """Curves of a contender's sets on one plant, by column: a row per regime, set and time."""
    made, seed, rows = load(task, name), task.number(f"worth {name} {number}"), []
    for form, regimes in _by_form(task, group).items():
        truth = truths[form]
        curves = judge.curves(_plant(task, constraints(task), form, number), made, truth, regimes, seed)
        for regime, found in curves.items():
            key = {"plant": number, "floor": float(truth.floor()), "regime": regime}
            rows += _rows_of(judge, found, key)
    return {str(key): values for key, values in pd.DataFrame(rows).to_dict("list").items()}


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


def _rows_of(judge: Judge, found: Curves, key: dict[str, object]) -> list[dict[str, object]]:
    """A row per set and time."""
    mean = mean_error(found.errors)
    return [
        {
            **key,
            "set": k,
            "time": float(t),
            "error": float(mean[k, i]),
            "covered": float(found.covered[k]),
            "widened": float(found.widened[k]),
        }
        for k in range(len(mean))
        for i, t in enumerate(judge.times)
    ]


def _tasks(task: Task, place: Constraints) -> list[Motion]:
    """The tasks, which no set was made for, at the plants' rate."""
    generator = torch.Generator().manual_seed(task.number("worth tasks"))
    kinds = task.cfg.worth.tasks.values()
    return [move for one in kinds for move in legs(place, one, task.cfg.worth.plant.rate, generator)]


def _artifacts(task: Task) -> list[Artifact]:
    """Every contender's sets, then plant by plant of each arm: some are complete while others are not."""
    every = list(arms(task).values())
    made = [sets(one, name) for one in every for name in contenders(one)]
    order = sorted((where, k) for k, one in enumerate(every) for where in plants(one))
    judged = [worth(every[k], *where) for where, k in order]
    few = [(every[k], where[0]) for where, k in order if where[1] == JUDGED]
    return [*made, *judged, *(estimators(*one) for one in few if one[1] < one[0].cfg.worth.compared)]


def _check(task: Task) -> None:
    """Refuse arms that MuJoCo would, and say what is left to be made takes."""
    require_consistent(task.arm)
    for arm in arms(task).values():
        for name, one in contenders(arm).items():
            # a file that holds too few: before hours of work, not after
            if one.maker == FROM_FILE and arm.store.find(sets(arm, name)) is None:
                make_sets(_orders(arm, constraints(arm), name))
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
    one = next(one for one in settings.contenders.values() if not one.bad)
    seed = np.random.SeedSequence(0)
    order = Order(place, tuple(task.trajectory.home or ()), settings, one, 1, seed)
    judge = Judge(settings, TorqueModel(place.body, settings.model))
    return cost(settings, contenders(task), pace(judge, _plant(task, place, "eyring", 0), order))


STAGE = Stage(_artifacts, check=_check)
