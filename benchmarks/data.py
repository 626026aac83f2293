"""Benchmarks of the identification and of picking a set: rls, greedy, design."""

import numpy as np
import torch

from benchmarks.setting import Setting
from benchmarks.timing import Result, medians, timed
from sidegan.design.criteria import DETERMINANT
from sidegan.design.greedy import greedy
from sidegan.design.information import information_of
from sidegan.design.optimal import a_optimal, d_optimal
from sidegan.identification import RIGID, Measurements, TorqueModel
from sidegan.identification.fit import recursive
from sidegan.identification.gather import gather

_LIBRARY, _PICKS = 100_000, 350
_SET, _STATES = 35, 40  # picked by optimal design, and states of each trajectory for its information
_EVALUATED = 2_000  # trajectories from which the cost of evaluating all of them is taken
_TRAJECTORIES, _SAMPLES = 6000, 1600  # of the largest identification
_MEASURED = 60  # of those trajectories


def rls(setting: Setting) -> Result:
    """Seconds to identify from 6000 trajectories on two threads, from a share of them.

    Regressors included, torques given; the stream is read once, in chunks.
    """
    count, samples = (5, 400) if setting.quick else (_MEASURED, _SAMPLES)
    recordings = noiseless(setting, count, samples)
    few = recordings[0][: setting.size(400)]
    y, tau = setting.problem.body.base_regressor(*few.states).numpy(), few.torque.numpy()
    model = TorqueModel(setting.problem.body, RIGID)
    run, theirs = medians(
        min(setting.repeats, 3),
        lambda: recursive(gather(model, iter(recordings)).sums, 1, 1e6),
        lambda: _recursion(y, tau),
    )
    whole = _TRAJECTORIES * _SAMPLES
    return Result(run, whole / (count * samples), theirs.wall * whole / len(few))


def selection(setting: Setting) -> Result:
    """Seconds for the greedy pick of 350 of 100,000, on one thread, beside NumPy on what is left."""
    count, picks = setting.size(_LIBRARY), setting.size(_PICKS)
    generator = torch.Generator().manual_seed(0)
    parameters = setting.problem.body.parameters_count
    diagonals = torch.rand(count, parameters, generator=generator, dtype=torch.float64)
    few = max(1, picks // 10)
    run, theirs = medians(
        min(setting.repeats, 3), lambda: greedy(diagonals, picks), lambda: _pick(diagonals.numpy(), few)
    )
    return Result(run, 1.0, theirs.wall * picks / few)


def design(setting: Setting) -> Result:
    """Seconds for the D-optimal pick of 35 of 100,000, on one thread, beside every candidate every time."""
    problem = setting.problem
    c = setting.start(setting.size(_LIBRARY))
    information = information_of(problem.body, problem.trajectory, c, _STATES)
    few, others = slice(0, _EVALUATED), {"A-optimal": lambda: a_optimal(information, _SET)}
    mean = information.mean
    evaluation = timed(lambda: DETERMINANT.value(mean + information.matrices(few)))
    share = len(information.packed[few]) / len(information)
    return Result(
        timed(lambda: d_optimal(information, _SET)),
        1.0,
        evaluation.wall * _SET / share,
        also={name: timed(pick).wall for name, pick in others.items()},
    )


def noiseless(setting: Setting, count: int, samples: int) -> list[Measurements]:
    """What would be measured without noise on ``count`` trajectories."""
    trajectory = setting.problem.trajectory
    motion = trajectory.roll_out(setting.start(count), trajectory.grid(samples))
    torque = setting.problem.body.torque(*motion[1:])
    return [Measurements(*parts) for parts in zip(*motion[1:], torque)]


def _recursion(y: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Estimate (p,) by the covariance form: one gain per sample."""
    covariance, estimate = 1e6 * np.eye(y.shape[2]), np.zeros(y.shape[2])
    for rows, torque in zip(y, tau):
        carried = covariance @ rows.T
        gain = np.linalg.solve(np.eye(len(rows)) + rows @ carried, carried.T).T
        estimate = estimate + gain @ (torque - rows @ estimate)
        covariance = covariance - gain @ carried.T
        covariance = (covariance + covariance.T) / 2  # else rounding makes it diverge
    return estimate


def _pick(diagonals: np.ndarray, count: int) -> list[int]:
    """The greedy pick as one would write it down."""
    left, previous, chosen = np.arange(len(diagonals)), np.zeros(diagonals.shape[1]), []
    for _ in range(count):
        far = np.linalg.norm(diagonals[left] - previous, axis=1)
        total = diagonals[left].sum(1)
        best = left[np.argmax(far / far.max() + total / total.max())]
        chosen.append(int(best))
        previous, left = diagonals[best], left[left != best]
    return chosen
