"""Draw trajectories until enough are valid."""

import logging
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.parallel import Report
from sidegan.base.typed import Count, Natural, Size
from sidegan.errors import InfeasibleError
from sidegan.validity import Validity, summarise_faults

_log = logging.getLogger(__name__)


@dataclass(frozen=True, kw_only=True)
class Expansion:
    """Growth of the library from the generator."""

    count: Count
    batch: Size = 500
    draws: Count = 600_000  # most samples drawn before giving up
    least: Natural = 1  # least number of valid trajectories; with fewer a generator is refused


@dataclass(frozen=True)
class Draws:
    """Valid trajectories, and the number of draws for them."""

    coefficients: Array  # the first valid ones [rad/s], (n, J, H, 2), n ≤ count
    drawn: int  # number of draws
    valid: int  # number of valid draws, not all of which may be kept


def draw_valid(
    sample: Callable[[int], Array],
    check: Callable[[Array], Validity],
    settings: Expansion,
    origin: str,
    report: Report | None = None,
) -> Draws:
    """Draw trajectories (B, J, H, 2) until enough are valid, or the number of draws is exhausted.

    ``origin`` describes the draws in messages, such as ``"drawn from eigen"``. Logs a warning if fewer than
    ``count`` are valid.

    Raises:
        InfeasibleError: when fewer than ``least`` are valid; names the violated constraints.
    """
    kept: list[Array] = []
    count = settings.count
    drawn = 0
    valid = 0
    rejecting: Validity | None = None  # of the last batch that had invalid ones
    while valid < count and drawn < settings.draws:
        c = sample(min(settings.batch, settings.draws - drawn))
        verdict = check(c)
        kept.append(c[verdict.valid])
        drawn += len(c)
        valid += len(kept[-1])
        rejecting = rejecting if verdict.valid.all() else verdict
        if report is not None:
            report(max(min(valid, count), drawn * count // settings.draws), count)
    if valid < settings.least:
        text = f"{valid} of {drawn} trajectories {origin} are valid, expected {settings.least} or more"
        if rejecting is not None:
            text += f"; of {len(rejecting.valid)} of them, {summarise_faults(rejecting.faults())}"
        raise InfeasibleError(text)
    if valid < count:
        _log.warning("only %d valid trajectories in %d draws, expected %d: %s", valid, drawn, count, origin)
    return Draws(np.concatenate(kept)[:count], drawn, valid)
