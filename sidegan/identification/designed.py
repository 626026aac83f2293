"""Sets of trajectories for what is uncertain of a model, each designed given those before it."""

import torch
from torch import Tensor

from sidegan.design import sequence
from sidegan.design.problem import Problem
from sidegan.design.sequence import Search
from sidegan.designer import Designer, DesignerSettings
from sidegan.errors import InfeasibleError
from sidegan.identification.uncertain import Uncertain

_POINTS = 10  # per second, at which the information of a trajectory is taken


def designed(
    problem: Problem,
    aim: Uncertain,
    count: int,
    settings: DesignerSettings,
    evaluations: int,
    search: Search,
    seed: int,
) -> Tensor:
    """A set of so many proven trajectories, (count, J, H, 2); the aim knows them then.

    The designer makes each with so many evaluations. Where it does not know the goal, ``sequence`` makes them
    with its search.

    Raises:
        InfeasibleError: when no trajectory is proven.
    """
    if aim.goal.form is None:
        return sequence.designed(problem, aim, count, search, torch.Generator().manual_seed(seed))
    designer = Designer(problem.constraints, problem.trajectory, settings, seed=seed)
    points = round(_POINTS * problem.trajectory.period)
    found = []
    for _ in range(count):
        design = designer.ask(aim=aim.asked(settings.rate), evaluations=evaluations)
        if design.coefficients is None:
            raise InfeasibleError("; ".join(design.blocked))
        aim.take(sequence.information(problem, aim, design.coefficients[None], points)[0])
        found.append(design.coefficients)
    return torch.stack(found)
