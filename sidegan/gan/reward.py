"""Differentiable exact physics, and the worth of trajectories for the prediction of torques.

The gradient of an energy |Y v|² of the information needs the torques of one parameter vector, and no
derivative of the regressor (``design.objective``); functions of the energies are plain torch.
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
    sample_times,
    wanted_torques,
)
from sidegan.design.problem import Problem
from sidegan.gan.metrics import noises
from sidegan.gan.settings import Reward
from sidegan.gan.tensors import numpy_array
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_MOTIONS, _STREAM = 60, 7  # random motions to predict, and their seed, unlike that of tests and metrics
_FEW = 8  # trajectories per batch that update the running means
_FORGETTING = 0.02  # least weight of an update of the means
_DIRECTIONS = 24  # directions in use, those with the largest shares of the error
_SEEDS = 200  # seeds that determine the directions of ``Energies``
_STATES_AT_ONCE = 4096  # per regressor: 10 MB at seven joints


class DirectionEnergies(torch.autograd.Function):
    """Energies Σ (wⱼ yⱼ v)² / T, (B, K), of directions v (p, K), for coefficients c [rad/s].

    ``weights``, (J,), scale each joint's equations y.
    """

    @staticmethod
    def forward(ctx: Any, c: Tensor, problem: Problem, directions: Array, weights: Array) -> Tensor:
        """The energies; torch passes the context."""
        ctx.save_for_backward(c)
        ctx.constants = problem, directions, weights
        trajectory, samples = problem.trajectory, problem.samples
        values = []
        for part in split(numpy_array(c), max(1, _STATES_AT_ONCE // samples)):
            y = problem.body.base_regressor(*trajectory.roll_out(part, trajectory.grid(samples))[1:])
            values.append(np.square(weights[:, None] * (y @ directions)).sum((1, 2)) / samples)
        return torch.tensor(np.concatenate(values))

    @staticmethod
    def backward(ctx: Any, *slopes: Tensor) -> tuple[Tensor, None, None, None]:
        """The gradient in the coefficients."""
        (c,), (problem, directions, weights) = ctx.saved_tensors, ctx.constants
        vectors = np.repeat(directions.T[None], len(c), 0)
        _, gradient = pull_back(problem, numpy_array(c), vectors, numpy_array(slopes[0]), certainty=weights)
        return torch.tensor(gradient).to(c), None, None, None


def violation(problem: Problem, c: Tensor, penalty: Penalty) -> Tensor:
    """Penalty of violated constraints, (B,): squared relative violations, mean over time."""
    none = np.zeros((len(c), 0, problem.body.parameters_count))
    value, gradient = pull_back(problem, numpy_array(c), none, none[:, :, 0], penalty)
    zero = (torch.tensor(gradient).to(c) * (c - c.detach())).sum((1, 2, 3))  # for its gradient
    return torch.tensor(value).to(c) + zero  # not every device has double precision


class Worth:
    """Reduction of the expected error of a generator's sets by each of its trajectories.

    The derivative of the error with respect to a set's information is taken at running means over the
    generator's samples: known directions count less and less.

    Args:
        problem: constraints and family of the trajectories.
        noise: torque noise in the identification.
    """

    def __init__(self, problem: Problem, noise: TorqueNoise) -> None:
        body, family = problem.body, problem.trajectory
        times = family.grid(problem.samples)
        motions = random_motions(problem, _MOTIONS, seed=_STREAM)
        wanted = wanted_torques(body, family, motions, sample_times(family))
        self.problem = problem
        self.prediction = Prediction(body, family, wanted, noise, times, 1 / len(times))
        self.means = np.zeros((2, *wanted.shape[1:]))
        self.seen = 0

    def __call__(self, c: Tensor) -> Tensor:
        """Log worth of coefficients [rad/s], (B, J, H, 2), relative to the running means, (B,) float64."""
        self.learn(numpy_array(c[:_FEW]))
        directions, shares = self.slope
        return (
            DirectionEnergies.apply(c, self.problem, directions, self.prediction.noise.weights)
            @ torch.tensor(shares)
        ).log()

    def learn(self, c: Array) -> None:
        """Update the running means of information and noise with trajectories [rad/s], (B, J, H, 2)."""
        new = np.stack([x.mean(0) for x in self.prediction.informations(c)])
        self.seen += 1
        self.means = self.means + max(_FORGETTING, 1 / self.seen) * (new - self.means)

    @property
    def slope(self) -> tuple[Array, Array]:
        """Directions (p, K) in which the error falls most, and their shares, (K,)."""
        directions, shares = error_slope(self.prediction.wanted, *self.means)
        return directions[:, :_DIRECTIONS], shares[:_DIRECTIONS] / shares[:_DIRECTIONS].sum()


class Energies:
    """Energies of trajectories in the directions in which the seeds' expected error falls, for a converter.

    Args:
        constraints: the arm in its workspace.
        trajectory: the family of trajectories.
        seeds: coefficients [rad/s], (N, J, H, 2).
    """

    def __init__(self, constraints: Constraints, trajectory: Trajectory, seeds: Array) -> None:
        self.problem = Problem(constraints, trajectory, len(sample_times(trajectory)))
        self.parts: dict[str, tuple[Array, Array, Array]] = {}
        for name, noise in noises(constraints.body).items():
            worth = Worth(self.problem, noise)
            worth.learn(seeds[:_SEEDS])
            self.parts[name] = *worth.slope, noise.weights

    def __call__(self, c: Array) -> Array:
        """Energies for each noise in turn, (N, K), about 1 for the seeds."""
        x = torch.tensor(c)
        return numpy_array(
            torch.cat([DirectionEnergies.apply(x, self.problem, v, w) for v, _, w in self.parts.values()], 1)
        )

    def worth(self, logs: Tensor, reward: Reward | None) -> Tensor:
        """Mean log worth from log energies, (B, K); 0-dimensional.

        In these directions the error is about Σ b / x̄ with mean energies x̄, and its slope b / x̄².
        """
        total = logs.new_zeros(())
        parts = logs.exp().split([len(shares) for _, shares, _ in self.parts.values()], 1)
        for x, (name, (_, shares, _)) in zip(parts, self.parts.items()):
            mean = x.mean(0).detach()
            slope = torch.tensor(shares).to(x) / mean.square()
            total = total + getattr(reward, name) * (x @ slope / (mean @ slope)).log().mean()
        return total
