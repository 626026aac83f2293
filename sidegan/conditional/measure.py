"""How well conditions are met, by the true check of every constraint they stand for."""

from dataclasses import dataclass, replace

import torch
from torch import Tensor

from sidegan.conditional.condition import Condition
from sidegan.conditional.generator import ConditionalGenerator
from sidegan.conditional.surroundings import family, regions
from sidegan.design.excitation import excite, mean_distance
from sidegan.validity import Constraints, Validity, check

RATE = 12.5  # [Hz] at which excitation is taken


@dataclass(frozen=True)
class Met:
    """Trajectories under K conditions, N each.

    Attributes:
        valid: whether all of it holds over the whole period, (K, N).
        condition: cond(YᵀY), (K, N).
        distance: mean distance of the coefficients of each condition's trajectories [rad/s], (K,).
    """

    valid: Tensor
    condition: Tensor
    distance: Tensor

    def summary(self) -> dict[str, float]:
        """Share that is valid, and medians."""
        return {
            "success": float(self.valid.double().mean()),
            "condition": float(self.condition.median()),
            "worst_success": float(self.valid.double().mean(1).min()),
            "distance": float(self.distance.mean()),
        }


def constraints_of(constraints: Constraints, condition: Condition) -> Constraints:
    """The workspace with what a batch of one asks for: its regions, and limits of its shares."""
    known = constraints.arm
    arm = replace(
        known,
        velocity_limit=known.velocity_limit * condition.velocity[0],
        torque_limit=known.torque_limit * condition.torque[0],
    )
    return Constraints(arm, [*constraints.regions, *regions(condition)], constraints.torque)


def checked(generator: ConditionalGenerator, condition: Condition, c: Tensor) -> Validity:
    """Validity of coefficients (N, J, H, 2) under a batch of one condition."""
    asking = generator.asking
    own = family(asking.trajectory, condition)
    return check(constraints_of(asking.constraints, condition), own, c)


def met(
    generator: ConditionalGenerator,
    conditions: Condition,
    count: int,
    random: torch.Generator,
    settled: bool = True,
) -> Met:
    """``count`` trajectories under each condition, settled or as the network makes them: true physics."""
    found = []
    body, trajectory = generator.asking.constraints.body, generator.asking.trajectory
    for k in range(len(conditions)):
        condition = conditions.row(k)
        c = generator.sample_each(condition.repeat(count), random, settled)
        own = family(trajectory, condition)
        fitness = excite(body, own, c, round(RATE * own.period)).eigenvalue_fitness
        distance = torch.tensor(mean_distance(c), dtype=torch.float64)
        found.append((checked(generator, condition, c).valid, fitness, distance))
    return Met(*map(torch.stack, zip(*found)))
