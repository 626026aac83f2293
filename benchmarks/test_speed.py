"""Rates of what runs and labs spend their time in: the LWR on its desk, the paper's trajectories."""

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.conftest import OURS, Rate
from benchmarks.opponents import Pinocchio, figaroh_regressor, mujoco_execute, mujoco_torque
from sidegan.base.arrays import Array, flatten
from sidegan.design.excitation import excite
from sidegan.design.goal import Goal
from sidegan.design.objective import Objective, Penalty
from sidegan.design.problem import Problem
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.side_gan import Data
from sidegan.gan.surrogates import Converter, SuccessPredictor
from sidegan.gan.tensors import tensor
from sidegan.gan.training import Run, train
from sidegan.identification import RIGID, Measurements, TorqueModel
from sidegan.identification.fit import least_squares
from sidegan.identification.gather import gather
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.pipeline.compose import composed
from sidegan.pipeline.run import run_stages
from sidegan.plant import Plant
from sidegan.plant.settings import IDEAL
from sidegan.robot import load_robot
from sidegan.validity import Constraints, Plane, check

pytestmark = pytest.mark.benchmark(timer=time.process_time)

_DESK = Plane((0.0, 0.0, 1.0), 0.10)
_SAMPLES = 80  # states of a trajectory
_CELLS = 160  # configurations of a trajectory that the opponent checks, 0.1 s apart
_EPOCHS = 2
_SEEDS = {"sidegan": ("gradient", 50), "gaco + compass": ("paper", 1)}  # method, seeds
_TOUCH = "computeCollisionsInParallel, samples and links only"
_PARALLEL, _INVERSE = "Pinocchio, rneaInParallel", "MuJoCo, mj_inverse"

CONSTRAINTS = Constraints(load_robot("kuka_lwr4"), [_DESK])
FAMILY, BODY = Trajectory(CONSTRAINTS.arm.joints), CONSTRAINTS.body
PROBLEM = Problem(CONSTRAINTS, FAMILY)


def start(count: int) -> Array:
    """Random trajectories, (count, 7, 6, 2) [rad/s]."""
    return PROBLEM.start(count, np.random.default_rng(0))


def motions(count: int, samples: int) -> list[list[tuple[np.ndarray, ...]]]:
    """States of random trajectories, one after another."""
    motion = FAMILY.roll_out(start(count), FAMILY.grid(samples))
    return [list(zip(*parts)) for parts in zip(*motion[1:])]


@pytest.mark.parametrize("by", [OURS, "Pinocchio", "FIGAROH"])
def test_regressor(rate: Rate, by: str) -> None:
    """Base regressor, and of ours and Pinocchio's YᵀY."""
    few, unit = 50, "states"
    if by == OURS:
        c = start(1000)
        work = partial(gram, BODY, FAMILY, c, samples=_SAMPLES)
        rate(work, len(c) * _SAMPLES, unit, both=work)
    elif by == "FIGAROH":
        states = [x[0] for x in FAMILY.roll_out(start(1), FAMILY.grid(_SAMPLES))[1:]]
        found = rate(figaroh_regressor(CONSTRAINTS.arm, BODY.base.columns, states), _SAMPLES, unit, 3)
        np.testing.assert_allclose(found, BODY.base_regressor(*states), atol=1e-9)
    else:
        loops, each = Pinocchio(CONSTRAINTS), motions(few, _SAMPLES)
        found = rate(lambda: [loops.gram(states) for states in each], few * _SAMPLES, unit)
        np.testing.assert_allclose(found, gram(BODY, FAMILY, start(few), _SAMPLES), rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("by", [OURS, _PARALLEL, _INVERSE])
def test_torque(rate: Rate, by: str) -> None:
    """Torques of states that are there."""
    states = [x.reshape(-1, FAMILY.joints) for x in FAMILY.roll_out(start(500), FAMILY.grid(_SAMPLES))[1:]]
    expected = BODY.torque(*states)
    if by == _PARALLEL:
        columns = [np.asfortranarray(x.T) for x in states]
        work, both = (partial(Pinocchio(CONSTRAINTS).torque, threads, columns) for threads in (1, 2))
    elif by == _INVERSE:
        work, both = mujoco_torque(CONSTRAINTS.arm, list(zip(*states))), None
    else:
        work = both = partial(BODY.torque, *states)
    found = rate(work, len(expected), "states", both=both)
    np.testing.assert_allclose(found, expected, atol=1e-9)


@pytest.mark.parametrize("by", [OURS, "mujoco.rollout"])
def test_plant(rate: Rate, by: str) -> None:
    """Motions of an arm under servos in MuJoCo, with our feed-forward and checks, and without."""
    plant = Plant(CONSTRAINTS.arm, IDEAL)
    count = 4
    motion = FAMILY.roll_out(start(count), FAMILY.times(IDEAL.rate))
    each = [Motion(motion.time, *(x[k : k + 1] for x in motion[1:])) for k in range(count)]
    amount = count * len(motion.time) / IDEAL.rate
    unit = "seconds of motion"
    expected = np.stack([plant.follow(motion).position for motion in each])
    if by == OURS:
        rate(lambda: [plant.follow(motion) for motion in each], amount, unit, 3)
        return
    stiffness, damping = plant.gains
    ahead = np.concatenate([motion.velocity[:, 1:], motion.velocity[:, -1:]], 1)
    torque = plant.body.torque(*motion[1:])
    targets = motion.position + (damping * ahead + torque) / stiffness
    first = np.concatenate([motion.position[:, 0], motion.velocity[:, 0]], 1)
    work, both = (partial(mujoco_execute, plant, threads, first, targets) for threads in (1, 2))
    found = rate(work, amount, unit, 3, both=both)
    np.testing.assert_allclose(found[:, :-1], expected[:, 1:], atol=1e-9)


def test_gradient_of_the_objective(rate: Rate) -> None:
    """Condition number, penalty of all constraints, and their gradient."""
    objective = Objective(PROBLEM, Goal(), Penalty(30.0))
    points = flatten(start(200), 2)
    slope = np.empty_like(points[0])
    rate(lambda: [objective(x, slope) for x in points], len(points) * PROBLEM.samples, "states")


@pytest.mark.parametrize("by", [OURS, "Pinocchio + coal, samples only", _TOUCH])
def test_validity(rate: Rate, by: str) -> None:
    """Whether trajectories hold every limit and keep clear, proven."""
    if by == OURS:
        work = partial(check, CONSTRAINTS, FAMILY, start(2000))
        rate(work, 2000, "trajectories", both=work)
    elif by == _TOUCH:
        arm, other, count = CONSTRAINTS.arm, Pinocchio(CONSTRAINTS), 50
        q = np.random.default_rng(0).uniform(
            arm.position_lower, arm.position_upper, (count * _CELLS, arm.joints)
        )
        positions = np.asfortranarray(q.T)
        work, both = (partial(other.touch, threads, positions) for threads in (1, 2))
        found = rate(work, count, "trajectories", both=both)
        expected = [min(CONSTRAINTS.distances_at(position).values()) < 0 for position in q]
        assert any(expected) and np.array_equal(found, expected)
    else:
        each = motions(10, _CELLS)
        loops = Pinocchio(CONSTRAINTS)
        rate(lambda: [loops.check(states) for states in each], len(each), "trajectories")


def test_generation(rate: Rate) -> None:
    """Trajectories from a generator of the usual size, in batches of a thousand."""
    seeds = tensor(start(200))
    scaling = Scaling.fit(seeds)
    network = Generator(*FAMILY.shape[:2], shortcut=True)
    network.start_from(scaling.image(seeds))
    made = TrajectoryGenerator(network.eval(), scaling, FAMILY, CONSTRAINTS.arm)
    rate(lambda: [made.sample(1000) for _ in range(10)], 10_000, "trajectories")


@pytest.mark.parametrize("by", _SEEDS)
def test_seeds(rate: Rate, by: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Seeds by the compiled search and by the paper's, failures, checks and their file included."""
    method, count = _SEEDS[by]
    words = ["+experiment=exp1", "scale=paper", f"seeds={method}", f"seeds.count={count}", "stages=[seeds]"]
    words += ["seeds.shipped=null"] if method == "paper" else []
    with caplog.at_level(logging.INFO):
        rate(lambda place: _run(place, *words), count, "seeds", 3, setup=_places(tmp_path))
    assert "seeds …" in caplog.text and "before" not in caplog.text, "made, and not read"


def test_set_of_ten(rate: Rate, tmp_path: Path) -> None:
    """Ten trajectories to execute, by excite's search, with controllers' files and the page."""
    words = ["+experiment=excite", "robot=kuka_lwr4", "goal.count=10"]
    rate(lambda place: _run(place, *words), 1, "sets", 3, setup=_places(tmp_path))


def _places(folder: Path) -> Callable[[], tuple[tuple[Path], dict[str, Any]]]:
    """A new folder for every round."""
    return lambda: ((folder / str(len([*folder.iterdir()])),), {})


def _run(place: Path, *words: str) -> None:
    common = "tracking=off", "parallel.workers=1", f"outputs={place}"
    (place / "run").mkdir(parents=True)
    run_stages(composed(*words, *common), place / "run", "speed")


def test_training(rate: Rate, tmp_path: Path) -> None:
    """Epochs of variant eigen on 1800 seeds, with untrained surrogates and the true physics after each."""
    cfg = composed("+experiment=exp1", "scale=paper")
    arm, sizes, seeds = CONSTRAINTS.arm, cfg.surrogates, start(1800)
    spectrum = excite(BODY, FAMILY, seeds[:200]).spectrum
    predictor = SuccessPredictor(arm, FAMILY, len(CONSTRAINTS.labels), sizes.width, sizes.margin_steps)
    converter = Converter(arm, FAMILY, spectrum.shape[1], sizes.width, sizes.feature_steps)
    converter.fit_standard(tensor(spectrum))
    for network in (predictor, converter):
        network.freeze()
    variant = replace(cfg.gan["eigen"], epochs=_EPOCHS, fitness_start=0)
    data = Data(CONSTRAINTS, FAMILY, seeds, predictor, converter)
    places = _places(tmp_path)
    rate(lambda place: train(variant, data, Run("eigen", 0, place)), _EPOCHS, "epochs", 2, setup=places)


@pytest.mark.parametrize("by", [OURS, "Pinocchio + NumPy"])
def test_recursive_least_squares(rate: Rate, by: str) -> None:
    """Base parameters of recordings read once, regressors included."""
    count, samples = (60, 1600) if by == OURS else (1, 1600)
    motion = FAMILY.roll_out(start(count), FAMILY.grid(samples))
    torque = BODY.torque(*motion[1:])
    model = TorqueModel(BODY, RIGID)
    opponent = Pinocchio(CONSTRAINTS)
    recordings = [Measurements(*parts) for parts in zip(*motion[1:], torque)]
    states = motions(count, samples)[0]

    def work() -> np.ndarray:
        if by == OURS:
            return least_squares(gather(model, iter(recordings)).sums).parameters
        return opponent.estimate(states, torque[0])

    found = rate(work, count * samples, "samples", 3)
    predicted = model.torque(found, *(x[0] for x in motion[1:]))
    np.testing.assert_allclose(predicted, torque[0], rtol=1e-3, atol=1e-3)
