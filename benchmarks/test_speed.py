"""Rates of what runs and labs spend their time in: the LWR on its desk, the paper's trajectories."""

import logging
import time
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import torch

from benchmarks.conftest import OURS, Rate
from benchmarks.opponents import Pinocchio
from sidegan.design.excitation import excite
from sidegan.design.objective import value_and_gradient
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.side_gan import Data
from sidegan.gan.surrogates import Converter, SuccessPredictor
from sidegan.gan.training import Run, train
from sidegan.identification import RIGID, Measurements, TorqueModel
from sidegan.identification.fit import LeastSquares
from sidegan.identification.gather import gather
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.compose import composed
from sidegan.pipeline.run import run_stages
from sidegan.robot import load_robot
from sidegan.validity import Constraints, Plane, check

pytestmark = pytest.mark.benchmark(timer=time.process_time)

_DESK = Plane((0.0, 0.0, 1.0), 0.10)
_SAMPLES = 80  # states of a trajectory
_CELLS = 160  # configurations of a trajectory that the opponent checks, 0.1 s apart
_SEEDS = {"sidegan": ("gradient", 50), "gaco + compass": ("paper", 1)}  # method, seeds
_EPOCHS = 2


CONSTRAINTS = Constraints(load_robot("kuka_lwr4"), [_DESK])
FAMILY, BODY = Trajectory(CONSTRAINTS.arm.joints), CONSTRAINTS.body
PROBLEM = Problem(CONSTRAINTS, FAMILY)


def start(count: int) -> torch.Tensor:
    """Random trajectories, (count, 7, 6, 2) [rad/s]."""
    return PROBLEM.start(count, torch.Generator().manual_seed(0))


def motions(count: int, samples: int) -> list[list[tuple[np.ndarray, ...]]]:
    """States of random trajectories, one after another."""
    motion = FAMILY.roll_out(start(count), FAMILY.grid(samples))
    return [list(zip(*parts)) for parts in zip(*(x.numpy() for x in motion[1:]))]


@pytest.mark.parametrize("by", [OURS, "Pinocchio"])
def test_regressor(rate: Rate, by: str) -> None:
    """Base regressor and YᵀY."""
    few, unit, loops = 50, "states", Pinocchio(CONSTRAINTS)
    if by == OURS:
        c = start(1000)
        rate(lambda: gram(BODY, FAMILY, c, samples=_SAMPLES), len(c) * _SAMPLES, unit)
        return
    each = motions(few, _SAMPLES)
    expected = gram(BODY, FAMILY, start(few), samples=_SAMPLES).numpy()
    np.testing.assert_allclose([loops.gram(states) for states in each], expected, rtol=1e-9, atol=1e-9)
    rate(lambda: [loops.gram(states) for states in each], few * _SAMPLES, unit)


def test_gradient_of_the_objective(rate: Rate) -> None:
    """Condition number, penalty of all constraints, and their gradient."""
    c = start(200)
    rate(lambda: value_and_gradient(PROBLEM, c, Penalty(30.0)), len(c) * PROBLEM.samples, "states")


@pytest.mark.parametrize("by", [OURS, "Pinocchio + coal, samples only"])
def test_validity(rate: Rate, by: str) -> None:
    """Whether trajectories hold every limit and keep clear, proven."""
    if by == OURS:
        c = start(2000)
        rate(lambda: check(CONSTRAINTS, FAMILY, c), len(c), "trajectories")
    else:
        each, loops = motions(10, _CELLS), Pinocchio(CONSTRAINTS)
        rate(lambda: [loops.check(states) for states in each], len(each), "trajectories")


def test_generation(rate: Rate) -> None:
    """Trajectories from a generator of the usual size, in batches of a thousand."""
    seeds, arm = start(200), CONSTRAINTS.arm
    scaling, network = Scaling.fit(seeds), Generator(*FAMILY.shape[:2], shortcut=True)
    network.start_from(scaling.image(seeds))
    made = TrajectoryGenerator(network.eval(), scaling, FAMILY, arm)
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
    cfg, seeds = composed("+experiment=exp1", "scale=paper"), start(1800)
    variant = replace(cfg.gan["eigen"], epochs=_EPOCHS, fitness_start=0)
    spectrum, arm, sizes = excite(BODY, FAMILY, seeds[:200]).spectrum, CONSTRAINTS.arm, cfg.surrogates
    predictor = SuccessPredictor(arm, FAMILY, len(CONSTRAINTS.labels), sizes.width, sizes.margin_steps)
    converter = Converter(arm, FAMILY, spectrum.shape[1], sizes.width, sizes.feature_steps)
    converter.fit_standard(spectrum)
    for network in (predictor, converter):
        network.freeze()
    data = Data(CONSTRAINTS, FAMILY, seeds, predictor, converter)
    places = _places(tmp_path)
    rate(lambda place: train(variant, data, Run("eigen", 0, place)), _EPOCHS, "epochs", 2, setup=places)


@pytest.mark.parametrize("by", [OURS, "Pinocchio + NumPy"])
def test_recursive_least_squares(rate: Rate, by: str) -> None:
    """Base parameters of recordings read once, regressors included."""
    count, samples = (60, 1600) if by == OURS else (1, 1600)
    motion = FAMILY.roll_out(start(count), FAMILY.grid(samples))
    torque = BODY.torque(*motion[1:])
    model, opponent = TorqueModel(BODY, RIGID), Pinocchio(CONSTRAINTS)
    recordings = [Measurements(*parts) for parts in zip(*motion[1:], torque)]
    states = motions(count, samples)[0]

    def work() -> np.ndarray:
        if by == OURS:
            return LeastSquares().fit(gather(model, iter(recordings))).parameters.numpy()
        return opponent.estimate(states, torque[0].numpy())

    found = torch.from_numpy(rate(work, count * samples, "samples", 3))
    predicted = model.torque(found, *(x[0] for x in motion[1:]))
    torch.testing.assert_close(predicted, torque[0], rtol=1e-3, atol=1e-3)
