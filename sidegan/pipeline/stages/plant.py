"""Stage plant: every excitation set executed on plants in MuJoCo, and identification from that.

Plants are those of the study of motions (``conf/varied``): friction that the model lacks, elastic joints,
links that differ from the description, and servos that feed forward the latter. Tests are scored without
noise.
"""

from dataclasses import asdict
from functools import partial

import numpy as np
import pandas as pd
import torch

from sidegan.base.storage import write_parquet
from sidegan.identification import Measurements, TorqueModel, estimate, score
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.identification import mean_errors
from sidegan.pipeline.stages.pools import ExcitationSet
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.stages.selection import excitation_sets
from sidegan.pipeline.task import RESULTS, Task
from sidegan.plant.varied import VariedPlant
from sidegan.report.tables import arrow
from sidegan.robot import require_consistent
from sidegan.worth import SetOf
from sidegan.worth.curves import disturbed, executed

_METHODS = {False: "ols", True: "weighted"}


def plant(task: Task, one: ExcitationSet) -> Artifact:
    """What identification from one set is worth when plants execute it."""
    return task.artifact(
        "plant",
        one.name,
        partial(_make, one=one),
        asdict(task.cfg.stand_in) | {"tests": task.cfg.identification.tests},
        {one.source.maker: one.source},
        training=one.training,
        title=f"plant/{one.title}",
        metrics=mean_errors,
    )


def _make(task: Task, build: Build, one: ExcitationSet) -> None:
    settings = task.cfg.stand_in
    learned = SetOf(one.family, task.load(one.source).coefficients)
    tests = SetOf(task.trajectory, random_valid(task, task.cfg.identification.tests, "tests").coefficients)
    model, rows = TorqueModel(task.body, settings.model), []
    for number, seed in enumerate(task.random("plants").spawn(settings.plants)):
        machine = VariedPlant(task.arm, settings.plant, settings.regime.form, seed)
        random = np.random.default_rng(task.number(f"plant {number}"))
        training, test = _recorded(task, machine, learned, random), _recorded(task, machine, tests)
        for weighted, method in _METHODS.items():
            parameters = estimate(method, model, training).parameters
            errors = score(model, parameters, test).nmse.tolist()
            key = (one.name, one.training or 0, number, weighted)
            rows += [(*key, joint, error) for joint, error in zip(task.arm.joint_names, errors)]
        build.report(number + 1, settings.plants)
    columns = ["set", "training", "repeat", "weighted", "joint", "nmse"]
    write_parquet(build.folder / RESULTS, arrow(pd.DataFrame(rows, columns=columns)))


def _recorded(
    task: Task, machine: VariedPlant, one: SetOf, random: np.random.Generator | None = None
) -> list[Measurements]:
    """What sensors see of every trajectory of a set, each a recording; without noise where none is drawn."""
    settings = task.cfg.stand_in
    (q, dq, ddq), torque, friction = executed(machine, one, settings.sensors)
    if random is not None:
        noise = [
            disturbed(x[None], machine.scale, settings.sensors, settings.regime.drift, 1, random)[0]
            for x in friction
        ]
        torque = torque + torch.stack(noise)
    return [Measurements(*parts) for parts in zip(q, dq, ddq, torque)]


STAGE = Stage(
    lambda task: [plant(task, one) for one in excitation_sets(task)],
    columnwise=True,
    check=lambda task: require_consistent(task.arm),
)
