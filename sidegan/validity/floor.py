"""Floor that an arm stands on, by its description, and what keeps above it where no link has a shape."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from sidegan.motion.arrays import chain_of, shapes_of
from sidegan.robot import Arm, Capsules
from sidegan.robot.mounting import stands
from sidegan.robot.visuals import foot
from sidegan.validity.capsules import clearances
from sidegan.validity.pairs import sampled
from sidegan.validity.regions import Plane, tables

_STANDS = 0.02  # share of random configurations above the floor from which on an arm stands on it
_STEPS = 1_000  # per metre: heights are whole millimetres
_ROUNDING = 1e-3  # of a step: an error that is none


@lru_cache(maxsize=16)
def floor_under(arm: Arm) -> Plane | None:
    """The floor that an arm stands on, by what its base looks like.

    None for an arm that is mounted so that it hangs, or reaches below that in nearly every configuration.
    """
    floor = Plane((0.0, 0.0, 1.0), _lowest(arm)[0])
    return floor if stands(arm) and _leaves(arm, floor) else None


def floor_is_known(arm: Arm) -> bool:
    """Whether shapes show where an arm stands, and its floor is no guess."""
    return _lowest(arm)[1]


@lru_cache(maxsize=16)
def planes_of(arm: Arm) -> tuple[list[Plane], int]:
    """Planes of an arm's description, and how many others it is behind in nearly every configuration."""
    planes = [Plane((x, y, z), offset) for x, y, z, offset in arm.planes]
    kept = [plane for plane in planes if _leaves(arm, plane)]
    return kept, len(planes) - len(kept)


@lru_cache(maxsize=16)
def with_points(arm: Arm) -> Arm:
    """An arm that has no shapes with its joint origins and its tip in their place; others as they are."""
    if len(arm.capsules.link):
        return arm
    places = np.stack([*arm.translation[1:], arm.tip])
    names = (*arm.joint_names[1:], "the tip")
    radius = np.zeros(arm.joints)
    points = Capsules(np.arange(arm.joints), places, places, radius, names, names, points=True)
    return replace(arm, capsules=points)


@lru_cache(maxsize=16)
def _lowest(arm: Arm) -> tuple[float, bool]:
    """Lowest point of what stands still [m], to the millimetre below, and whether that is known."""
    height, known = foot(arm)
    return math.floor(height * _STEPS + _ROUNDING) / _STEPS, known


def _leaves(arm: Arm, plane: Plane) -> bool:
    """Whether every link that can be is before a plane in some share of random configurations."""
    arm = with_points(arm)
    moving = np.flatnonzero(arm.capsules.link >= 0)
    guarded = np.stack([np.zeros_like(moving), moving], 1)
    shapes = shapes_of(arm.capsules, guarded[:0], guarded, tables([plane]))
    clear = clearances(chain_of(arm), shapes, sampled(arm))[1] > 0  # (N, K)
    clear = clear[:, clear.any(0)]
    return clear.size > 0 and float(clear.all(1).mean()) >= _STANDS
