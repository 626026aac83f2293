"""Benchmarks of the physics on two threads: regressor, gradient, validity."""

import numpy as np
import pinocchio as pin
import torch
from torch import Tensor

from benchmarks import figaroh
from benchmarks.limits import operations, peak
from benchmarks.setting import Setting
from benchmarks.timing import Row, medians, rate, threads
from sidegan.design.objective import value_and_gradient
from sidegan.design.penalty import Penalty
from sidegan.motion.dynamics import gram
from sidegan.robot.oracle import capsule_geometry, pinocchio_model
from sidegan.validity import check

_THREADS = 2
_SAMPLES = 80  # states per trajectory
_CELLS = 160  # configurations per trajectory that the opponent checks, 0.1 s apart
_COUNTED = 10  # trajectories whose operations are counted
_SHARED = f"{_THREADS} such loops on as many cores"
_PEAK = "operations counted, at the measured peak of a matrix product"

States = tuple[np.ndarray, np.ndarray, np.ndarray]


def regressor(setting: Setting) -> Row:
    """Base regressor and Gram matrices in states/s, beside Pinocchio called state by state."""
    c = setting.start(setting.size(1000))
    few = c[: setting.size(50)]
    states = _states(setting, few, _SAMPLES)
    model = pinocchio_model(setting.arm)
    data, columns = model.createData(), setting.body.base.columns.numpy()

    def loop() -> None:
        for first in range(0, len(states), _SAMPLES):
            of_one = states[first : first + _SAMPLES]
            full = [pin.computeJointTorqueRegressor(model, data, *state) for state in of_one]
            y = np.concatenate(full)[:, columns]
            _ = y.T @ y / _SAMPLES

    with threads(_THREADS):
        ours, theirs = medians(
            setting.repeats, lambda: gram(setting.body, setting.trajectory, c, _SAMPLES), loop
        )
    count = operations(lambda: gram(setting.body, setting.trajectory, c[:_COUNTED], _SAMPLES)) / (
        len(c[:_COUNTED]) * _SAMPLES
    )
    return rate(
        "regressor",
        "states/s",
        len(c) * _SAMPLES,
        ours,
        _THREADS * len(states) / theirs.wall,
        peak(_THREADS) / count,
        1.2e6,
        against=f"Pinocchio from Python, NumPy's YᵀY: {_SHARED}",
        limit_is=f"{count:,.0f} {_PEAK}",
        threads=_THREADS,
        also={"FIGAROH": figaroh.regressor_rate(model, columns, states, _SAMPLES, _THREADS)},
    )


def gradient(setting: Setting) -> Row:
    """Fitness, penalty and gradient in states/s, beside autograd through the regressor."""
    problem = setting.problem
    c = setting.start(setting.size(200))
    few = c[: setting.size(20)]

    def through_the_regressor(x: Tensor = few) -> None:
        x = x.clone().requires_grad_(True)
        subspace = setting.body.base.subspace
        motion = problem.motion(x)[1:]
        y = setting.body.base_regressor(*motion).flatten(1, 2)
        grams = y.transpose(1, 2) @ y / problem.samples
        spectrum = torch.linalg.eigvalsh(subspace.T @ grams @ subspace)
        states = [part.flatten(0, 1) for part in motion]
        margins = setting.constraints.margins(*states).values()
        violation = sum((margin.clamp_max(0) ** 2).sum() for margin in margins)
        ((spectrum[:, -1] / spectrum[:, 0]).log().sum() + violation).backward()

    with threads(_THREADS):
        ours, theirs = medians(
            setting.repeats, lambda: value_and_gradient(problem, c, Penalty(30.0)), through_the_regressor
        )
    counted = c[:_COUNTED]
    count = operations(lambda: value_and_gradient(problem, counted, Penalty(30.0))) / (
        len(counted) * problem.samples
    )
    return rate(
        "gradient",
        "states/s",
        len(c) * problem.samples,
        ours,
        len(few) * problem.samples / theirs.wall,
        peak(_THREADS) / count,
        4e5,
        against="torch's autograd through the regressor",
        limit_is=f"{count:,.0f} {_PEAK}",
        threads=_THREADS,
    )


def validity(setting: Setting) -> Row:
    """Checks in trajectories/s, beside torques and distances by Pinocchio and coal at samples only."""
    c = setting.start(setting.size(2000))
    states = _states(setting, c[: setting.size(10)], _CELLS)
    model = pinocchio_model(setting.arm)
    geometry = capsule_geometry(setting.arm)
    for first, second in setting.constraints.pairs.tolist():
        geometry.addCollisionPair(pin.CollisionPair(first, second))
    data, shapes = model.createData(), geometry.createData()

    def loop() -> None:
        for q, dq, ddq in states:
            pin.rnea(model, data, q, dq, ddq)
            pin.computeDistances(model, data, geometry, shapes, q)

    with threads(_THREADS):
        ours, theirs = medians(
            setting.repeats, lambda: check(setting.constraints, setting.trajectory, c), loop
        )
    counted = c[:_COUNTED]
    count = operations(lambda: check(setting.constraints, setting.trajectory, counted)) / len(counted)
    return rate(
        "validity",
        "trajectories/s",
        len(c),
        ours,
        _THREADS * len(states) / _CELLS / theirs.wall,
        peak(_THREADS) / count,
        3000.0,
        against=f"Pinocchio and coal at {_CELLS} samples, nothing between: {_SHARED}",
        limit_is=f"{count:,.0f} {_PEAK}",
        threads=_THREADS,
    )


def _states(setting: Setting, c: Tensor, samples: int) -> list[States]:
    motion = setting.trajectory.roll_out(c, setting.trajectory.grid(samples))
    return list(zip(*(x.flatten(0, 1).numpy() for x in motion[1:])))
