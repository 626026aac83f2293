"""What the compiled evaluation of single trajectories is given."""

import numpy as np
import torch
from torch import Tensor

from sidegan.design.evaluation import NAMES
from sidegan.design.problem import HOPELESS, Problem
from sidegan.motion.compiled import evaluation as kernel
from sidegan.motion.compiled.chain import array
from sidegan.motion.compiled.operations import columns_of_links


class CompiledEvaluation:
    """Log fitness and violations, (B, 1 + G), by a compiled kernel; not to be shared among threads."""

    def __init__(self, problem: Problem, distance: float) -> None:
        self.subject = _subject(problem)
        self.measure = kernel.Measure(problem.diagonal, problem.weakest, HOPELESS, distance)
        self.room = kernel.room(self.subject)
        self.kept = [0, *(1 + NAMES.index(name) for name in problem.constraints.labels)]

    def __call__(self, c: np.ndarray) -> np.ndarray:
        """Of coefficients (B, J, H, 2) [rad/s], contiguous."""
        numbers = np.empty((len(c), kernel.NUMBERS))
        kernel.evaluate(self.subject, self.measure, c.reshape(*c.shape[:2], -1), numbers, self.room)
        return numbers[:, self.kept]


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
