"""Benchmarks of the physics: regressor, gradient, validity."""

import numpy as np
import pinocchio as pin
import torch
from torch import Tensor

from benchmarks.setting import Setting
from benchmarks.timing import Row, medians, rate_row
from sidegan.dynamics import gram
from sidegan.robot.oracle import capsule_geometry, pinocchio_model
from sidegan.seeds.objective import Penalty, value_and_gradient
from sidegan.validity import check

_SAMPLES = 80  # states per trajectory
_CELLS = 160  # configurations per trajectory that the opponent checks, 0.1 s apart


def regressor(setting: Setting) -> Row:
    """Base regressor and Gram matrices in states/s, beside Pinocchio called state by state."""
    c = setting.start(setting.size(250))
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

    ours, theirs = medians(setting.repeats, lambda: gram(setting.body, setting.trajectory, c, _SAMPLES), loop)
    rates = len(c) * _SAMPLES / ours, len(states) / theirs
    return rate_row("regressor", "states/s", *rates, "Pinocchio in a Python loop, NumPy's YᵀY")


def gradient(setting: Setting) -> Row:
    """Fitness, penalty and gradient in states/s, beside autograd through the regressor."""
    problem = setting.problem
    c = setting.start(setting.size(50))
    few = c[: setting.size(20)]

    def through_the_regressor() -> None:
        x = few.clone().requires_grad_(True)
        subspace = setting.body.base.subspace
        grams = gram(setting.body, setting.trajectory, x, problem.samples)
        spectrum = torch.linalg.eigvalsh(subspace.T @ grams @ subspace)
        states = [part.flatten(0, 1) for part in problem.motion(x)[1:]]
        margins = setting.constraints.margins(*states).values()
        violation = sum((margin.clamp_max(0) ** 2).sum() for margin in margins)
        ((spectrum[:, -1] / spectrum[:, 0]).log().sum() + violation).backward()

    ours, theirs = medians(
        setting.repeats, lambda: value_and_gradient(problem, c, Penalty(30.0)), through_the_regressor
    )
    rates = len(c) * problem.samples / ours, len(few) * problem.samples / theirs
    return rate_row("gradient", "states/s", *rates, "torch's autograd through the regressor")


def validity(setting: Setting) -> Row:
    """Checks in trajectories/s, beside torques and distances by Pinocchio and coal at samples only."""
    c = setting.start(setting.size(100))
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

    ours, theirs = medians(setting.repeats, lambda: check(setting.constraints, setting.trajectory, c), loop)
    rates = len(c) / ours, len(states) / _CELLS / theirs
    return rate_row(
        "validity", "trajectories/s", *rates, f"Pinocchio and coal at {_CELLS} samples, nothing between"
    )


def _states(setting: Setting, c: Tensor, samples: int) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
    motion = setting.trajectory.roll_out(c, setting.trajectory.grid(samples))
    return list(zip(*(x.flatten(0, 1).numpy() for x in motion[1:])))
