"""Benchmarks of the physics on two threads: regressor, gradient, validity."""

from functools import partial

import numpy as np
import pinocchio as pin
import torch
from torch import Tensor

from benchmarks.setting import Setting
from benchmarks.timing import Result, medians
from sidegan.design.objective import value_and_gradient
from sidegan.design.penalty import Penalty
from sidegan.motion.dynamics import gram
from sidegan.robot.oracle import capsule_geometry, pinocchio_model
from sidegan.validity import check

_THREADS = 2
_SAMPLES = 80  # states per trajectory
_CELLS = 160  # configurations per trajectory that the opponent checks, 0.1 s apart


def regressor(setting: Setting) -> Result:
    """Base regressor and Gram matrices in states/s, beside Pinocchio called state by state."""
    c = setting.start(setting.size(1000))
    states = _states(setting, c[: setting.size(50)], _SAMPLES)
    model = pinocchio_model(setting.problem.constraints.arm)
    data, columns = model.createData(), setting.problem.body.base.columns.numpy()
    grams = partial(gram, setting.problem.body, setting.problem.trajectory, samples=_SAMPLES)

    def loop() -> None:
        for first in range(0, len(states), _SAMPLES):
            of_one = states[first : first + _SAMPLES]
            full = [pin.computeJointTorqueRegressor(model, data, *state) for state in of_one]
            y = np.concatenate(full)[:, columns]
            _ = y.T @ y / _SAMPLES

    run, theirs = medians(setting.repeats, lambda: grams(c), loop)
    return Result(run, len(c) * _SAMPLES, _THREADS * len(states) / theirs.wall)


def gradient(setting: Setting) -> Result:
    """Fitness, penalty and gradient in states/s, beside autograd through the regressor."""
    problem = setting.problem
    c = setting.start(setting.size(200))
    few = c[: setting.size(20)]

    def through_the_regressor() -> None:
        x = few.clone().requires_grad_(True)
        subspace = setting.problem.body.base.subspace
        motion = problem.motion(x)[1:]
        y = setting.problem.body.base_regressor(*motion).flatten(1, 2)
        grams = y.transpose(1, 2) @ y / problem.samples
        spectrum = torch.linalg.eigvalsh(subspace.T @ grams @ subspace)
        states = [part.flatten(0, 1) for part in motion]
        margins = setting.problem.constraints.margins(*states).values()
        violation = sum((margin.clamp_max(0) ** 2).sum() for margin in margins)
        ((spectrum[:, -1] / spectrum[:, 0]).log().sum() + violation).backward()

    run, theirs = medians(
        setting.repeats, lambda: value_and_gradient(problem, c, Penalty(30.0)), through_the_regressor
    )
    return Result(run, len(c) * problem.samples, len(few) * problem.samples / theirs.wall)


def validity(setting: Setting) -> Result:
    """Checks in trajectories/s, beside torques and distances by Pinocchio and coal at samples only."""
    c = setting.start(setting.size(2000))
    states = _states(setting, c[: setting.size(10)], _CELLS)
    model = pinocchio_model(setting.problem.constraints.arm)
    geometry = capsule_geometry(setting.problem.constraints.arm)
    for first, second in setting.problem.constraints.pairs.tolist():
        geometry.addCollisionPair(pin.CollisionPair(first, second))
    data, shapes = model.createData(), geometry.createData()
    proof = partial(check, setting.problem.constraints, setting.problem.trajectory)

    def loop() -> None:
        for q, dq, ddq in states:
            pin.rnea(model, data, q, dq, ddq)
            pin.computeDistances(model, data, geometry, shapes, q)

    run, theirs = medians(setting.repeats, lambda: proof(c), loop)
    return Result(run, len(c), _THREADS * len(states) / _CELLS / theirs.wall)


def _states(setting: Setting, c: Tensor, samples: int) -> list[tuple[np.ndarray, ...]]:
    """Positions, velocities and accelerations of all trajectories, state by state."""
    motion = setting.problem.trajectory.roll_out(c, setting.problem.trajectory.grid(samples))
    return list(zip(*(x.flatten(0, 1).numpy() for x in motion[1:])))
