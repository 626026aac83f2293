"""The pick of an excitation set from a pool, by the configured method."""

from dataclasses import dataclass
from typing import Literal

from sidegan.base.arrays import Array
from sidegan.base.typed import Count, Positive
from sidegan.design.greedy import greedy
from sidegan.design.information import information_of
from sidegan.design.optimal import Candidates, a_optimal, d_optimal
from sidegan.errors import ConfigError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

_HELD = 20_000  # trajectories whose information is held: 300 MB at 43 parameters


@dataclass(frozen=True, kw_only=True)
class Selection:
    """How many trajectories are picked from a pool, and by what."""

    count: Count = 35
    method: Literal["greedy", "d_optimal", "a_optimal"] = "greedy"
    # of each joint's torque [N·m], by which the joints count; not for greedy
    noise: list[Positive] | None = None

    def __post_init__(self) -> None:
        if self.method == "greedy" and self.noise is not None:
            raise ConfigError("the paper's greedy score knows no noise: choose another method")


def choose(settings: Selection, body: RigidBody, trajectory: Trajectory, c: Array, diagonal: Array) -> Array:
    """Indices of the trajectories picked from a pool (N, J, H, 2), in the order of choice, (count,).

    The paper's score looks at the diagonal of each YᵀY / T over the base columns alone, (N, p).
    """
    if settings.method == "greedy":
        return greedy(diagonal, settings.count)

    def information(some: Array) -> Array:
        return information_of(body, trajectory, some, noise=settings.noise)

    pick = a_optimal if settings.method == "a_optimal" else d_optimal
    pool = information(c) if len(c) <= _HELD else Candidates(len(c), lambda index: information(c[index]))
    return pick(pool, settings.count)
