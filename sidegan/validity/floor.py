"""Floor and planes of an arm's description, and points that stand for links of arms without shapes."""

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

_STANDS = 0.02  # least share of random configurations above the floor of an arm that stands on it
_STEPS = 1_000  # per metre: heights are whole millimetres
_ROUNDING = 1e-3  # of a step, for rounding errors


@lru_cache(maxsize=16)
def floor_under(arm: Arm) -> Plane | None:
    """The floor that an arm stands on, from the shapes of its base.

    None if the arm does not stand upright, or reaches below its base in nearly every configuration.
    """
    floor = Plane((0.0, 0.0, 1.0), _lowest(arm)[0])
    return floor if stands(arm) and _leaves(arm, floor) else None


def floor_is_known(arm: Arm) -> bool:
    """Whether an arm's floor follows from shapes, rather than being a guess."""
    return _lowest(arm)[1]


@lru_cache(maxsize=16)
def planes_of(arm: Arm) -> tuple[list[Plane], int]:
    """Planes of an arm's description, and the number of ignored ones, which it is nearly always behind."""
    planes = [Plane((x, y, z), offset) for x, y, z, offset in arm.planes]
    kept = [plane for plane in planes if _leaves(arm, plane)]
    return kept, len(planes) - len(kept)


@lru_cache(maxsize=16)
def with_points(arm: Arm) -> Arm:
    """The arm, with joint origins and tip as its shapes if it has none."""
    if len(arm.capsules.link):
        return arm
    places = np.stack([*arm.translation[1:], arm.tip])
    owners = (*arm.joint_names[1:], "the tip")
    radius = np.zeros(arm.joints)
    points = Capsules(np.arange(arm.joints), places, places, radius, owners, points=True)
    return replace(arm, capsules=points)


@lru_cache(maxsize=16)
def _lowest(arm: Arm) -> tuple[float, bool]:
    """Lowest point of the fixed links [m], rounded down to a millimetre, and whether it is known."""
    height, known = foot(arm)
    return math.floor(height * _STEPS + _ROUNDING) / _STEPS, known


def _leaves(arm: Arm, plane: Plane) -> bool:
    """Whether all links that can be in front of a plane are so in enough random configurations."""
    arm = with_points(arm)
    moving = np.flatnonzero(arm.capsules.link >= 0)
    guarded = np.stack([np.zeros_like(moving), moving], 1)
    shapes = shapes_of(arm.capsules, guarded[:0], guarded, tables([plane]))
    clear = clearances(chain_of(arm), shapes, sampled(arm))[1] > 0  # (N, K)
    clear = clear[:, clear.any(0)]
    return clear.size > 0 and float(clear.all(1).mean()) >= _STANDS
