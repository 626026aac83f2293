"""Sets of trajectories for what is uncertain of a model, each designed given those before it."""

from functools import partial

import torch
from torch import Tensor

from sidegan.design import sequence
from sidegan.design.problem import Problem
from sidegan.design.sequence import Search, told
from sidegan.designer import Designer, DesignerSettings, one_by_one
from sidegan.identification.uncertain import Uncertain
from sidegan.motion.compiled import compiled

_POINTS = 10  # per second, at which what a trajectory tells is taken


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

    The designer makes each with so many evaluations. Where it does not know the goal, or nothing is
    compiled, ``sequence`` makes them with its search.

    Raises:
        InfeasibleError: when a search proves no trajectory.
    """
    if not compiled() or aim.goal.form is None:
        return sequence.designed([problem], aim, count, search, torch.Generator().manual_seed(seed))[1]
    designer = Designer(problem.constraints, problem.trajectory, settings, seed=seed)
    points = round(_POINTS * problem.trajectory.period)

    def take(c: Tensor) -> None:
        aim.take(told(problem, aim, c[None], points))

    return one_by_one(designer, partial(aim.asked, settings.rate), take, count, evaluations)
