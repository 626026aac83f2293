"""Stage plant: execute every excitation set on the arm in MuJoCo, and identify from what was recorded."""

from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from sidegan.base.parallel import Report
from sidegan.base.storage import write_parquet
from sidegan.identification import Measurements, Model, estimate, score
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import RESULTS, Task
from sidegan.pipeline.stages.common import produce_all
from sidegan.pipeline.stages.identification import excitation_set
from sidegan.pipeline.stages.random import random_valid
from sidegan.pipeline.tracking import Tracker
from sidegan.plant import Executed, PlantSettings, execute_all
from sidegan.recording.recording import Recording
from sidegan.recording.segments import preprocess
from sidegan.recording.settings import Preprocessing
from sidegan.report.tables import arrow
from sidegan.robot import Arm

NAME = "MuJoCo plant"
_METHODS = {False: "ols", True: "weighted"}


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Execute and identify every set."""
    task = Task(cfg, store)
    wanted = task.sets()
    stamps = [task.plant(*one) for one in wanted]
    produce_all(task, "plant (%)", stamps, [partial(_make, task, *one) for one in wanted])
    for one, stamp in zip(wanted, stamps):
        mean = pd.read_parquet(store.require(stamp) / RESULTS).groupby("weighted").nmse.mean()
        names = {False: "unweighted", True: "weighted"}
        title = task.named(*one)
        tracker.log_metrics({f"plant/{title}/{names[bool(key)]}": value for key, value in mean.items()})


def _make(task: Task, name: str, training: int, folder: Path, work: Path, report: Report) -> None:
    family, coefficients = excitation_set(task, name, training)
    tests = random_valid(task, task.cfg.identification.tests, "tests")[0]
    model = Model(task.body)
    rows = []
    repeats = task.cfg.replication.repeats
    for repeat in range(repeats):
        training_data = _recorded(task, family, coefficients, f"plant {repeat}")
        test_data = _recorded(task, task.trajectory, tests, f"plant tests {repeat}")
        for weighted, method in _METHODS.items():
            found = estimate(method, model, training_data)
            errors = score(model, found.parameters, test_data).nmse.tolist()
            joints = task.arm.joint_names
            rows += [(name, training, repeat, weighted, joint, e) for joint, e in zip(joints, errors)]
        report(repeat + 1, repeats)
    columns = ["set", "training", "repeat", "weighted", "joint", "nmse"]
    write_parquet(folder / RESULTS, arrow(pd.DataFrame(rows, columns=columns)))


def _recorded(task: Task, family: Trajectory, c: torch.Tensor, purpose: str) -> list[Measurements]:
    """What the plant's sensors saw along every trajectory, preprocessed as a real recording is."""
    random = np.random.SeedSequence(task.number(purpose))
    settings = replace(task.cfg.recording, bandwidth=family.harmonics / family.period, cutoff=None)
    plant = PlantSettings(**asdict(task.cfg.plant))
    read = partial(measurements_of, arm=task.arm, settings=settings)
    return execute_all(task.arm, plant, family, c, random, read, workers=1)


def measurements_of(executed: Executed, arm: Arm, settings: Preprocessing) -> Measurements:
    """Measurements from an execution, through the same door as a recording."""
    signals = (executed.time, executed.position, executed.velocity)
    recording = Recording(NAME, arm.joint_names, *signals, torque=executed.torque)
    parts = list(zip(*preprocess(recording, settings)))[1:]
    return Measurements(*(torch.cat(part) for part in parts))
