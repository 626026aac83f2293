"""How well an arm's capsules and pieces stand for its shapes: against coal on the original meshes."""

import torch

from sidegan.robot import Arm, collides
from sidegan.validity.constraints import Constraints


def shape_accuracy(arm: Arm, configurations: int = 2_000, seed: int = 0) -> tuple[float, float]:
    """Share of free configurations that are refused, and of colliding ones that are missed.

    The configurations are random within the joints' limits. Links collide if their own shapes, as the
    description has them, do; pairs that the arm does not keep apart since they are neighbours or named are
    left out, those that are said never to touch are not. A share of none is 0.

    Args:
        arm: whose description and meshes are still there.
        configurations: their number.
        seed: of the random configurations.

    Raises:
        InfeasibleError: when links always touch that nobody named.
        RobotError: when the description is gone.
    """
    constraints = Constraints(arm, torque=False)
    random = torch.Generator().manual_seed(seed)
    draw = torch.rand(configurations, arm.joints, generator=random, dtype=torch.float64)
    q = torch.lerp(arm.position_lower, arm.position_upper, draw)
    exempt = [one.links for one in constraints.exempt if one.why != "never touch"]
    collided = torch.from_numpy(collides(arm, q.numpy(), exempt))
    still = torch.zeros_like(q)
    margins = constraints.margins(q, still, still, still).get("collision", q.new_ones(len(q), 1))
    refused = (margins < 0).any(1)
    free = ~collided
    return _share(refused[free]), _share(~refused[collided])


def _share(marks: torch.Tensor) -> float:
    return float(marks.double().mean()) if len(marks) else 0.0
