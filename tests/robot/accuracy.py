"""How well an arm's capsules and pieces stand for its shapes, by coal on the description's own meshes."""

import torch

from sidegan.validity import Constraints

from .judge import Judge


def shape_accuracy(constraints: Constraints, judge: Judge, configurations: int) -> tuple[float, float]:
    """Shares of free random configurations that are refused, and of colliding ones that are missed."""
    arm, random = constraints.arm, torch.Generator().manual_seed(0)
    draw = torch.rand(configurations, arm.joints, generator=random, dtype=torch.float64)
    q = torch.lerp(arm.position_lower, arm.position_upper, draw)
    collided = torch.from_numpy(judge.colliding(judge.configurations(q.numpy())))
    refused = (constraints.at_rest(q).get("collision", q.new_ones(len(q), 1)) < 0).any(1)
    return _share(refused[~collided]), _share(~refused[collided])


def _share(marks: torch.Tensor) -> float:
    return float(marks.double().mean()) if len(marks) else 0.0
