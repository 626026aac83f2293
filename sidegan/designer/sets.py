"""The designer at work for more than one answer: sets, and where a search begins that knows more than it."""

from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from sidegan.design.prediction import Prediction
from sidegan.design.problem import Problem
from sidegan.design.sequence import Begin
from sidegan.designer.aim import Aim, noise_at
from sidegan.designer.designer import Designer
from sidegan.designer.settings import DesignerSettings
from sidegan.errors import InfeasibleError

_REACH = 0.8  # of the tightest limit, that a random start uses where the designer proves nothing
_SEEDS = 2**31


def one_by_one(
    designer: Designer, asked: Callable[[], Aim], take: Callable[[Tensor], None], count: int, evaluations: int
) -> Tensor:
    """A set of so many proven trajectories, (count, J, H, 2), each designed given those before it.

    Args:
        designer: who makes them.
        asked: what the next one shall be good for.
        take: counts a trajectory, (J, H, 2), as known.
        count: how many.
        evaluations: for each.

    Raises:
        InfeasibleError: when one is not proven.
    """
    found = []
    for _ in range(count):
        design = designer.ask(aim=asked(), evaluations=evaluations)
        if design.coefficients is None:
            raise InfeasibleError("; ".join(design.blocked))
        take(design.coefficients)
        found.append(design.coefficients)
    return torch.stack(found)


def variance_of(prediction: Prediction, rate: float) -> Aim:
    """What of an expected error is variance, for a designer that takes torques at a rate [Hz]."""
    return Aim(
        "variance",
        prediction.known.information.numpy(),
        noise_at(rate, prediction.per_second),
        model=prediction.model,
        tasks=prediction.tasks.numpy(),
    )


def begin_designed(settings: DesignerSettings, evaluations: int) -> Begin:
    """Searches for the whole of an expected error begin where the designer makes its variance small."""
    return partial(_begin, settings, evaluations)


def _begin(
    settings: DesignerSettings,
    evaluations: int,
    problem: Problem,
    prediction: Prediction,
    count: int,
    generator: torch.Generator,
) -> Tensor:
    """So many of the designer's trajectories, (count, J, H, 2), each from points of its own."""
    aim, found = variance_of(prediction, settings.rate), []
    for seed in torch.randint(_SEEDS, (count,), generator=generator).tolist():
        designer = Designer(problem.constraints, problem.trajectory, settings, seed=seed)
        c = designer.ask(aim=aim, evaluations=evaluations).coefficients
        found.append(problem.start(1, generator, _REACH)[0] if c is None else c)
    return torch.stack(found)
