"""Stage plant: every excitation set executed on the arm in MuJoCo, and identification from that."""

from dataclasses import asdict, fields, replace
from functools import partial

import numpy as np
import pandas as pd
import torch

from sidegan.base.storage import write_parquet
from sidegan.identification import Measurements, TorqueModel, estimate, score
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.identification import mean_errors
from sidegan.pipeline.stages.pools import ExcitationSet
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.stages.selection import excitation_sets
from sidegan.pipeline.task import RESULTS, Task
from sidegan.plant import Executed, Plant
from sidegan.recording.recording import Recording
from sidegan.recording.segments import preprocess
from sidegan.recording.settings import Preprocessing
from sidegan.report.tables import arrow
from sidegan.robot import Arm, require_consistent

NAME = "MuJoCo plant"
_METHODS = {False: "ols", True: "weighted"}


def plant(task: Task, one: ExcitationSet) -> Artifact:
    """What identification from one set is worth when the plant executes it."""
    repeats = {"repeats": task.cfg.replication.repeats, "tests": task.cfg.identification.tests}
    recorded = {one.name: getattr(task.cfg.recording, one.name) for one in fields(Preprocessing)}
    return task.artifact(
        "plant",
        one.name,
        partial(_make, one=one),
        asdict(task.cfg.plant) | repeats | {"recording": recorded},
        {one.source.maker: one.source},
        training=one.training,
        title=f"plant/{one.title}",
        metrics=mean_errors,
    )


def _make(task: Task, build: Build, one: ExcitationSet) -> None:
    coefficients = task.load(one.source).coefficients
    tests = random_valid(task, task.cfg.identification.tests, "tests").coefficients
    model, rows, repeats = TorqueModel(task.body), [], task.cfg.replication.repeats
    machine = Plant(task.arm, task.cfg.plant)
    families = (one.family, task.trajectory)  # of the set and of the tests
    followed = [list(machine.follow_each(*both)) for both in zip(families, (coefficients, tests))]
    for repeat in range(repeats):
        purposes = (f"plant {repeat}", f"plant tests {repeat}")
        training, test = (_recorded(task, machine, *each) for each in zip(families, followed, purposes))
        for weighted, method in _METHODS.items():
            parameters = estimate(method, model, training).parameters
            errors = score(model, parameters, test).nmse.tolist()
            key = (one.name, one.training or 0, repeat, weighted)
            rows += [(*key, joint, error) for joint, error in zip(task.arm.joint_names, errors)]
        build.report(repeat + 1, repeats)
    columns = ["set", "training", "repeat", "weighted", "joint", "nmse"]
    write_parquet(build.folder / RESULTS, arrow(pd.DataFrame(rows, columns=columns)))


def _recorded(
    task: Task, machine: Plant, family: Trajectory, true: list[Executed], purpose: str
) -> list[Measurements]:
    """What the plant's sensors saw along every trajectory, preprocessed as a real recording is."""
    random = np.random.SeedSequence(task.number(purpose))
    settings = replace(task.cfg.recording, bandwidth=family.harmonics / family.period, cutoff=None)
    return [measurements_of(one, task.arm, settings) for one in machine.sense_each(true, random)]


def measurements_of(executed: Executed, arm: Arm, settings: Preprocessing) -> Measurements:
    """Measurements from an execution, through the same door as a recording."""
    signals = (executed.time, executed.position, executed.velocity)
    recording = Recording(NAME, arm.joint_names, *signals, torque=executed.torque)
    parts = list(zip(*preprocess(recording, settings)))[1:]
    return Measurements(*(torch.cat(part) for part in parts))


STAGE = Stage(
    lambda task: [plant(task, one) for one in excitation_sets(task)],
    columnwise=True,
    check=lambda task: require_consistent(task.arm),
)
