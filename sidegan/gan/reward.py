"""Exact physics that gradients pass through, and what trajectories are worth for the prediction of torques.

The gradient of an energy |Y v|² of the information needs the torques of one parameter vector, never a
differentiated regressor (``design.objective``); what follows from the energies is plain torch.
"""

from typing import Any

import numpy as np
import torch
from torch import Tensor

from sidegan.base.arrays import Array, split
from sidegan.design.objective import Penalty, pull_back
from sidegan.design.prediction import (
    Prediction,
    TorqueNoise,
    error_slope,
    random_motions,
    sampled,
    wanted_torques,
)
from sidegan.design.problem import Problem
from sidegan.gan.metrics import noises
from sidegan.gan.settings import Reward
from sidegan.gan.tensors import array, tensor
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_MOTIONS, _STREAM = 60, 7  # random motions that are to be predicted; those of tests and metrics are others
_FEW = 8  # trajectories of a batch that count for the running means
_FORGETTING = 0.02  # share of these in the means, once there were enough
_DIRECTIONS = 24  # that count, those with the largest shares of the error
_SEEDS = 200  # that these are of
_STATES_AT_ONCE = 4096  # whose regressor is kept: 10 MB at seven joints


def energies(problem: Problem, c: Tensor, directions: Array, weights: Array) -> Tensor:
    """``energies_of``, through which gradients pass."""
    return _Energies.apply(c, problem, directions, weights)


def energies_of(problem: Problem, c: Array, directions: Array, weights: Array) -> Array:
    """Energies Σ (wⱼ yⱼ v)² / T, (B, K), of directions v (p, K), of coefficients c [rad/s].

    Each joint's equations y count by its weight, (J,).
    """
    times, trajectory, values = problem.trajectory.grid(problem.samples), problem.trajectory, []
    for part in split(c, max(1, _STATES_AT_ONCE // problem.samples)):
        y = problem.body.base_regressor(*trajectory.roll_out(part, times)[1:])
        values.append(np.square(weights[:, None] * (y @ directions)).sum((1, 2)) / problem.samples)
    return np.concatenate(values)


def violation(problem: Problem, c: Tensor, penalty: Penalty) -> Tensor:
    """Penalty of violated constraints, (B,) float64: squared relative violations, mean over time."""
    return _Violation.apply(c, problem, penalty)


class _Energies(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: Problem, directions: Array, weights: Array) -> Tensor:
        ctx.save_for_backward(c)
        ctx.constants = problem, directions, weights
        return tensor(energies_of(problem, array(c), directions, weights))

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None, None]:
        (c,), (problem, directions, weights) = ctx.saved_tensors, ctx.constants
        vectors = np.repeat(directions.T[None], len(c), 0)
        _, gradient = pull_back(problem, array(c), vectors, array(slopes[0]), certainty=weights)
        return tensor(gradient).to(c), None, None, None


class _Violation(torch.autograd.Function):
    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: Problem, penalty: Penalty) -> Tensor:
        none = np.zeros((len(c), 0, problem.body.parameters_count))
        value, gradient = pull_back(problem, array(c), none, none[:, :, 0], penalty)
        ctx.save_for_backward(tensor(gradient).to(c))
        return tensor(value)

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None]:
        (gradient,) = ctx.saved_tensors
        return slopes[0].to(gradient)[:, None, None, None] * gradient, None, None


class Worth:
    """How much less the expected error of a generator's sets is by each of its trajectories.

    The slope of the error in a set's information is taken at running means of what the generator makes: what
    is known already counts ever less.

    Args:
        problem: of which the trajectories are.
        noise: under which a model is identified from them.
    """

    def __init__(self, problem: Problem, noise: TorqueNoise) -> None:
        body, family, times = problem.body, problem.trajectory, problem.trajectory.grid(problem.samples)
        motions = random_motions(problem, _MOTIONS, seed=_STREAM)
        wanted = wanted_torques(body, family, motions, sampled(family))
        self.problem = problem
        self.prediction = Prediction(body, family, wanted, noise, times, 1 / len(times))
        self.means, self.seen = np.zeros((2, *wanted.shape[1:])), 0

    def __call__(self, c: Tensor) -> Tensor:
        """Log worth of coefficients [rad/s] (B, J, H, 2) beside that of the running means, (B,) float64."""
        self.learn(array(c[:_FEW]))
        directions, shares = self.slope
        return (energies(self.problem, c, directions, self.prediction.noise.weights) @ tensor(shares)).log()

    def learn(self, c: Array) -> None:
        """Take trajectories [rad/s] (B, J, H, 2) into the running means of information and noise."""
        new, self.seen = np.stack([x.mean(0) for x in self.prediction.informations(c)]), self.seen + 1
        self.means = self.means + max(_FORGETTING, 1 / self.seen) * (new - self.means)

    @property
    def slope(self) -> tuple[Array, Array]:
        """Directions (p, K) in which the error falls most, and their shares, (K,)."""
        directions, shares = error_slope(self.prediction.wanted, *self.means)
        return directions[:, :_DIRECTIONS], shares[:_DIRECTIONS] / shares[:_DIRECTIONS].sum()


class Energies:
    """Energies of trajectories in the directions in which the seeds' expected errors fall, for a converter.

    Args:
        constraints: of the arm in its workspace.
        trajectory: the family of trajectories.
        seeds: coefficients [rad/s], (N, J, H, 2).
    """

    def __init__(self, constraints: Constraints, trajectory: Trajectory, seeds: Array) -> None:
        self.problem = Problem(constraints, trajectory, len(sampled(trajectory)))
        self.parts: dict[str, tuple[Array, Array, Array]] = {}
        for name, noise in noises(constraints.body).items():
            worth = Worth(self.problem, noise)
            worth.learn(seeds[:_SEEDS])
            self.parts[name] = *worth.slope, noise.weights

    def __call__(self, c: Array) -> Array:
        """Energies under one noise after the other, (N, K), about one for the seeds."""
        return np.concatenate([energies_of(self.problem, c, v, w) for v, _, w in self.parts.values()], 1)

    def worth(self, logs: Tensor, reward: Reward) -> Tensor:
        """Mean log worth by the logarithms of energies, (B, K); 0-dimensional.

        In these directions the error is about Σ b / x̄ with the mean energies x̄, its slope b / x̄².
        """
        total, sizes = logs.new_zeros(()), [len(shares) for _, shares, _ in self.parts.values()]
        for x, (name, (_, shares, _)) in zip(logs.exp().split(sizes, 1), self.parts.items()):
            mean = x.mean(0).detach()
            slope = tensor(shares).to(x) / mean.square()
            total = total + getattr(reward, name) * (x @ slope / (mean @ slope)).log().mean()
        return total
