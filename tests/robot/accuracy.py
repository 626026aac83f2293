"""How well an arm's capsules and pieces stand for its shapes, by coal on the description's own meshes."""

import torch

from sidegan.robot import Arm
from sidegan.validity import Constraints

from .judge import Facts, Judge


def shape_accuracy(arm: Arm, configurations: int) -> tuple[float, float]:
    """Shares of free random configurations that are refused, and of colliding ones that are missed.

    Pairs that the arm does not keep apart are left out, but for those that are said never to touch.
    """
    constraints, random = Constraints(arm, torque=False), torch.Generator().manual_seed(0)
    draw = torch.rand(configurations, arm.joints, generator=random, dtype=torch.float64)
    q = torch.lerp(arm.position_lower, arm.position_upper, draw)
    exempt = [list(one.links) for one in constraints.exempt if one.why != "never touch"]
    judge = Judge(arm.urdf, arm.joint_names, Facts(exempt=exempt))
    collided = torch.from_numpy(judge.colliding(judge.configurations(q.numpy())))
    refused = (constraints.at_rest(q).get("collision", q.new_ones(len(q), 1)) < 0).any(1)
    return _share(refused[~collided]), _share(~refused[collided])


def _share(marks: torch.Tensor) -> float:
    return float(marks.double().mean()) if len(marks) else 0.0
