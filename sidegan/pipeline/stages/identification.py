"""Stages identification and plant: identify the arm from every excitation set, and predict test torques.

Stage identification adds noise to exact motions. Stage plant uses plants, arms simulated in MuJoCo with
unmodelled friction, elastic joints, links that differ from the description, and servos with a feedforward of
the described arm. Test torques are exact. Sets without a training have number 0.
"""

from collections.abc import Callable
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd

from sidegan.base.storage import write_frame
from sidegan.design.prediction import TorqueNoise
from sidegan.identification import Measurements, TorqueModel, estimate, score, study
from sidegan.pipeline.artifact import Artifact, Build, Metrics
from sidegan.pipeline.context import EXPECTED, FACTS, RESULTS, RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.stages.baselines import prediction, test_trajectories
from sidegan.pipeline.stages.selection import ExcitationSet, excitation_sets, generated_alone, picked
from sidegan.plant.recorded import recorded
from sidegan.plant.varied import VariedPlant
from sidegan.robot import require_consistent


def identification(run: RunContext, excitation: ExcitationSet) -> Artifact:
    """Errors of identification from a set."""
    return _of_set("identification", run, excitation, _identify, asdict(run.cfg.identification))


def plant(run: RunContext, excitation: ExcitationSet) -> Artifact:
    """Errors of models identified from what simulated plants record of a set."""
    study_settings = run.cfg.identification
    settings = asdict(run.cfg.plants) | {"tests": study_settings.tests, "reach": study_settings.reach}
    return _of_set("plant", run, excitation, _execute, settings)


def _of_set(
    maker: str,
    run: RunContext,
    excitation: ExcitationSet,
    make: Callable[..., None],
    settings: dict[str, Any],
) -> Artifact:
    make, inputs = partial(make, excitation=excitation), {excitation.source.maker: excitation.source}
    return run.artifact(
        maker, excitation.name, make, settings, inputs, excitation.training, metrics=_mean_errors
    )


def _mean_errors(folder: Path) -> Metrics:
    """Mean nMSE over joints and repeats, which are noise draws or plants, unweighted and weighted."""
    mean = pd.read_parquet(folder / RESULTS).groupby("weighted").nmse.mean()
    names = {False: "nmse", True: "nmse_weighted"}
    return {names[bool(key)]: float(value) for key, value in mean.items()}


def _identify(run: RunContext, build: Build, excitation: ExcitationSet) -> None:
    """Write drawn errors with facts, and expected errors under both kinds of noise; see ``study``."""
    settings, body = run.cfg.identification, run.cell.body
    test_set = run.cell.trajectory, test_trajectories(run)
    family, c = excitation.family, run.load(excitation.source).coefficients
    random = run.random("identification")
    results, facts = study.drawn_errors(
        body, excitation.name, (family, c), test_set, settings, random, build.report
    )
    expected = study.expected_errors(body, (family, c), test_set, settings).assign(noise="paper")
    # also under constant noise, as of real sensors, with joints weighted by it
    predicting = prediction(run, TorqueNoise.constant(body, settings.constant), family)
    information, noise = (x.sum(0, keepdims=True) for x in predicting.informations(c))
    nmse = predicting.nmse(information, noise)[0].tolist()
    columns = {"weighted": True, "joint": run.cell.arm.joint_names, "nmse": nmse, "noise": "constant"}
    expected = pd.concat([expected, pd.DataFrame(columns)]).assign(set=excitation.name)
    for file, frame in {RESULTS: results, FACTS: facts, EXPECTED: expected}.items():
        write_frame(build.folder / file, frame.assign(training=excitation.training or 0))


def _execute(run: RunContext, build: Build, excitation: ExcitationSet) -> None:
    """Write errors on test torques without noise; a repeat is a plant, the same ones for every set."""
    settings, model = run.cfg.plants, TorqueModel(run.cell.body, run.cfg.plants.model)
    executed = run.load(excitation.source).coefficients
    tests = test_trajectories(run)
    rows = []
    for number, seed in enumerate(run.random("plants").spawn(settings.count)):
        simulated = VariedPlant(run.cell.arm, settings.plant, seed)
        random = np.random.default_rng(run.number(f"plant {number}"))
        training = recorded(simulated, excitation.family, executed, settings.sensors, random)
        unseen = recorded(simulated, run.cell.trajectory, tests, settings.sensors)
        learned, test = ([Measurements(*parts) for parts in zip(*states)] for states in (training, unseen))
        for weighted, method in ((False, "ols"), (True, "weighted")):
            parameters = estimate(method, model, learned).parameters
            errors = score(model, parameters, test).nmse.tolist()
            key = (excitation.name, excitation.training or 0, number, weighted)
            rows += [(*key, joint, error) for joint, error in zip(run.cell.arm.joint_names, errors)]
        build.report(number + 1, settings.count)
    columns = ["set", "training", "repeat", "weighted", "joint", "nmse"]
    write_frame(build.folder / RESULTS, pd.DataFrame(rows, columns=columns))


STAGES = {
    "identification": Stage(
        lambda run: [
            identification(run, each) for each in [*excitation_sets(run), *picked(run, generated_alone(run))]
        ]
    ),
    "plant": Stage(
        lambda run: [plant(run, each) for each in excitation_sets(run)],
        check=lambda run: require_consistent(run.cell.arm),
    ),
}
