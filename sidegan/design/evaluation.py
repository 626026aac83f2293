"""What an optimiser without gradients asks of single trajectories: log fitness and worst margins, compiled.

One question costs 0.2 ms, and most of it is arithmetic.
"""

import numpy as np
import torch
from torch import Tensor

from sidegan.design.problem import HOPELESS, Problem
from sidegan.kernels import evaluation as kernel
from sidegan.motion.arrays import array
from sidegan.motion.operations import columns_of_links
from sidegan.validity.constraints import NAMES


class Evaluation:
    """Log fitness and violations of trajectories of a problem, at its samples; not for several threads.

    Args:
        problem: of which they are.
        distance: clearance that counts like a whole limit [m].
    """

    def __init__(self, problem: Problem, distance: float) -> None:
        self.problem, self._subject = problem, _subject(problem)
        self._measure = kernel.Measure(problem.diagonal, problem.weakest, HOPELESS, distance)
        self._room = kernel.room(self._subject)
        self._kept = [0, *(1 + NAMES.index(name) for name in problem.constraints.labels)]

    def __call__(self, c: np.ndarray) -> np.ndarray:
        """Log fitness, and the worst relative margin of each constraint with its sign turned, (B, 1 + G).

        Coefficients [rad/s] are (B, J, H, 2), contiguous; constraints are in the order of their labels.
        """
        numbers = np.empty((len(c), kernel.NUMBERS))
        kernel.evaluate(self._subject, self._measure, c.reshape(*c.shape[:2], -1), numbers, self._room)
        return numbers[:, self._kept]


def _subject(problem: Problem) -> kernel.Subject:
    constraints, trajectory, body = problem.constraints, problem.trajectory, problem.body
    arm, base = constraints.arm, body.base
    limit = arm.torque_limit

    def functions(times: Tensor, orders: int) -> Tensor:
        return torch.stack([trajectory.basis(times, order).flatten(1).T for order in range(orders)])

    tensors = {
        "subspace": base.subspace,
        "parameters": arm.inertial_parameters.reshape(1, 1, -1),
        "home": limit.new_tensor(trajectory.home),
        "lower": arm.position_lower,
        "upper": arm.position_upper,
        "speed": arm.velocity_limit,
        "higher": constraints.higher_rows,
        "torque": limit if constraints.torque else torch.full_like(limit, torch.inf),
        "basis": functions(trajectory.grid(problem.samples), 4 if constraints.higher else 3),
    }
    columns = columns_of_links(base.columns, body.joints)
    arrays = {name: array(x) for name, x in tensors.items()}
    return kernel.Subject(body.chain, constraints.shapes, columns, **arrays)
