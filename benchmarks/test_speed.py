"""Rates of what runs and labs spend their time in: the LWR on its desk, the paper's trajectories."""

import logging
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path
from pkgutil import resolve_name
from typing import Any

import numpy as np
import pytest

from benchmarks import device
from benchmarks.conftest import OURS, Rate
from benchmarks.opponents import Figaroh, Mujoco, Pinocchio, frax_torque
from sidegan.base.arrays import Array, flatten
from sidegan.design.objective import Goal, Objective, Penalty
from sidegan.design.problem import Problem
from sidegan.gan.training import TrainingRun, train_variant
from sidegan.identification import RIGID, Measurements, TorqueModel
from sidegan.identification.fit import gather, least_squares
from sidegan.motion.dynamics import gram
from sidegan.motion.trajectory import Motion, Trajectory
from sidegan.pipeline.compose import composed
from sidegan.pipeline.run import run_stages
from sidegan.plant import IDEAL, Plant
from sidegan.robot import load_robot
from sidegan.validity import Constraints, Plane, check

pytestmark = pytest.mark.benchmark(timer=time.process_time)

_DESK = Plane((0.0, 0.0, 1.0), 0.10)
_SAMPLES = 80  # states of a trajectory
_CELLS = 160  # configurations of a trajectory that the opponent checks, 0.1 s apart
_SEEDS = {"sidegan": ("gradient", 50), "gaco + compass": ("paper", 1)}  # method, seeds
_TOUCH = "computeCollisionsInParallel, samples and links only"
_FIGAROH = "FIGAROH, ten iterations at 5 Hz"
_PARALLEL, _INVERSE, _FRAX = "Pinocchio, rneaInParallel", "MuJoCo, mj_inverse", "frax, compiled by JAX"

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


@pytest.mark.parametrize("by", [OURS, "Pinocchio", "FIGAROH", "MuJoCo, unit bodies"])
def test_regressor(rate: Rate, by: str) -> None:
    """Base regressor, and of ours and Pinocchio's YᵀY."""
    few = 50
    unit = "states"
    loops = Pinocchio(CONSTRAINTS)
    if by == OURS:
        c = start(1000)
        work = partial(gram, BODY, FAMILY, c, samples=_SAMPLES)
        rate(work, len(c) * _SAMPLES, unit, both=work)
        return
    if by != "Pinocchio":
        (states,) = motions(1, _SAMPLES)
        columns = BODY.base.columns
        parts = [np.array(x) for x in zip(*states)]
        expected = BODY.base_regressor(*parts)
        if by == "FIGAROH":
            other = Figaroh(CONSTRAINTS.arm)
            assert len(other.base_columns(*parts)) == len(columns)
            found = rate(lambda: other.regressor(columns, *parts), _SAMPLES, unit, 3)
            found = found.reshape(CONSTRAINTS.arm.joints, _SAMPLES, -1).swapaxes(0, 1)
        else:
            found = rate(partial(Mujoco(CONSTRAINTS.arm).regressor, states), _SAMPLES, unit, 3)[..., columns]
        np.testing.assert_allclose(found, expected, atol=1e-9)
        return
    each = motions(few, _SAMPLES)
    expected = gram(BODY, FAMILY, start(few), samples=_SAMPLES)
    np.testing.assert_allclose([loops.gram(states) for states in each], expected, rtol=1e-9, atol=1e-9)
    rate(lambda: [loops.gram(states) for states in each], few * _SAMPLES, unit)


@pytest.mark.parametrize("by", [OURS, _PARALLEL, _INVERSE, _FRAX])
def test_torque(rate: Rate, by: str, tmp_path: Path) -> None:
    """Torques of states that are there."""
    states = [x.reshape(-1, FAMILY.joints) for x in FAMILY.roll_out(start(500), FAMILY.grid(_SAMPLES))[1:]]
    expected = BODY.torque(*states)
    columns = [np.asfortranarray(x.T) for x in states]
    if by == _FRAX:
        work = both = partial(frax_torque(CONSTRAINTS.arm, tmp_path), *states)
    elif by == _PARALLEL:
        work, both = (partial(Pinocchio(CONSTRAINTS).torque, threads, columns) for threads in (1, 2))
    elif by == _INVERSE:
        work = partial(Mujoco(CONSTRAINTS.arm).torque, list(zip(*states)))
        both = None
    else:
        work = both = partial(BODY.torque, *states)
    found = rate(work, len(expected), "states", both=both)
    np.testing.assert_allclose(np.asarray(found), expected, atol=1e-9)


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
    work, both = (partial(Mujoco.execute, plant, threads, first, targets) for threads in (1, 2))
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
        arm = CONSTRAINTS.arm
        other = Pinocchio(CONSTRAINTS)
        noise = np.random.default_rng(0)
        count = 50
        q = noise.uniform(arm.position_lower, arm.position_upper, (count * _CELLS, arm.joints))
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
    variant, data = device.task()
    made = resolve_name(variant._target_)(variant, data).generator.eval()
    rate(lambda: [made.sample(1000) for _ in range(10)], 10_000, "trajectories")


@pytest.mark.parametrize("by", [*_SEEDS, _FIGAROH])
def test_seeds(rate: Rate, by: str, tmp_path: Path, caplog: pytest.LogCaptureFixture) -> None:
    """Seeds by the compiled search and by the paper's, failures, checks and their file included."""
    if by == _FIGAROH:
        search = Figaroh(CONSTRAINTS.arm)
        names = CONSTRAINTS.arm.joint_names
        work = partial(search.optimise, names, freq=5, max_iterations=10)
        found = rate(work, 1, "seeds", 1)
        assert len(found) > 5 and min(found) < found[0], "its optimiser has made the condition number smaller"
        return
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
    variant, data = device.task()
    places = _places(tmp_path)
    rate(
        lambda place: train_variant(variant, data, TrainingRun("eigen", 0, place)),
        device.EPOCHS,
        "epochs",
        2,
        setup=places,
    )


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
