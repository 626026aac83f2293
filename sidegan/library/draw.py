"""Drawing until enough trajectories are valid."""

import logging
from collections.abc import Callable, Mapping
from dataclasses import dataclass

import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.typed import Count, Natural, Size
from sidegan.design.problem import Problem
from sidegan.errors import InfeasibleError
from sidegan.validity import Validity, check, summarise_faults

_TRIES = 1000  # draws for each random trajectory, most of them

log = logging.getLogger(__name__)


@dataclass(frozen=True)
class Expansion:
    """Growth of the library from the generator."""

    count: Count
    batch: Size
    draws: Count  # most samples drawn before giving up
    least: Natural  # valid ones, with fewer of which a generator is refused


@dataclass(frozen=True)
class Draws:
    """Valid trajectories, and how many had to be drawn for them."""

    coefficients: Tensor  # the first valid ones [rad/s], (n, J, H, 2), n ≤ count
    count: int  # how many there should be
    drawn: int  # trajectories that were drawn
    valid: int  # how many of those are valid; may be more than were kept
    last: int  # size of the last batch
    faults: Mapping[str, int]  # how many of the last batch violate what, where not enough are valid

    def require(self, least: int, origin: str) -> "Draws":
        """These draws, after a warning where fewer than ``count`` are valid.

        The origin says what was drawn, for people, such as ``"drawn from eigen"``.

        Raises:
            InfeasibleError: when fewer than ``least`` are valid; says what the others violate.
        """
        if self.valid < least:
            valid = f"only {self.valid}" if self.valid else "none"
            verb = "are" if self.valid > 1 else "is"
            raise InfeasibleError(
                f"{valid} of {self.drawn} trajectories {origin} {verb} valid; "
                f"of the last {self.last}, {summarise_faults(self.faults)}"
            )
        if self.valid < self.count:
            numbers = f"{self.valid} valid trajectories in {self.drawn} draws, {self.count} were wanted"
            log.warning("%s: %s", numbers, origin)
        return self


def random_valid(problem: Problem, count: int, generator: torch.Generator, reach: float) -> Draws:
    """Valid trajectories that nobody optimised, (count, J, H, 2), and how many were drawn for them.

    Every joint uses ``reach`` of its tightest position or velocity limit.

    Raises:
        InfeasibleError: when random trajectories are almost never valid.
    """
    draws = draw_valid(
        lambda n: problem.start(n, generator, reach),
        lambda c: check(problem.constraints, problem.trajectory, c),
        count,
        count,
        _TRIES * count,
    )
    return draws.require(count, "drawn at random in this workspace")


def draw_valid(
    sample: Callable[[int], Tensor],
    check: Callable[[Tensor], Validity],
    count: int,
    batch: int,
    most: int,
    report: Report | None = None,
) -> Draws:
    """Draw trajectories (B, J, H, 2) until ``count`` are valid, or ``most`` are drawn, ``batch`` at once.

    The report is given (done, total).
    """
    kept: list[Tensor] = []
    drawn = valid = 0
    while valid < count and drawn < most:
        c = sample(min(batch, most - drawn))
        verdict = check(c)
        kept.append(c[verdict.valid])
        drawn, valid = drawn + len(c), valid + len(kept[-1])
        if report is not None:
            report(max(min(valid, count), drawn * count // most), count)
    faults = verdict.faults() if valid < count else {}
    return Draws(torch.cat(kept)[:count], count, drawn, valid, len(c), faults)
