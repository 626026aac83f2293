"""Floor that an arm stands on, by its description, and what keeps above it where no link has a shape."""

import math
from dataclasses import replace
from functools import lru_cache

import torch

from sidegan.robot import Arm, Capsules
from sidegan.robot.looks import visual_parts
from sidegan.robot.mounting import stands
from sidegan.validity.capsules import capsule_axes
from sidegan.validity.pairs import sampled
from sidegan.validity.regions import Plane

_STANDS = 0.02  # share of random configurations above the floor from which on an arm stands on it
_STEPS = 1_000  # per metre: heights are whole millimetres
_ROUNDING = 1e-3  # of a step: an error that is none


@lru_cache(maxsize=16)
def floor_under(arm: Arm) -> Plane | None:
    """The floor at the lowest point of an arm's base, or at z = 0 where the base has no shape.

    None for an arm that is mounted so that it hangs, or reaches below that in nearly every configuration.
    """
    height = _lowest(arm)
    above = stands(arm) and _above(with_points(arm), height) >= _STANDS
    return Plane((0.0, 0.0, 1.0), height) if above else None


@lru_cache(maxsize=16)
def with_points(arm: Arm) -> Arm:
    """An arm that has no shapes with its joint origins and its tip in their place; others as they are."""
    if len(arm.capsules.link):
        return arm
    places = torch.stack([*arm.translation[1:], arm.tip])
    names = (*arm.joint_names[1:], "the tip")
    radius = torch.zeros(arm.joints, dtype=torch.float64)
    points = Capsules(torch.arange(arm.joints), places, places, radius, names, names, points=True)
    return replace(arm, capsules=points)


def _lowest(arm: Arm) -> float:
    """Lowest point of what stands still [m], to the millimetre below."""
    heights = [float(part.vertices[:, 2].min()) for part in visual_parts(arm, base=True)]
    if not heights:
        still, capsules = arm.capsules.link < 0, arm.capsules
        ends = torch.minimum(capsules.a, capsules.b)[still, 2] - capsules.radius[still]
        heights = ends.tolist()
    return math.floor(min(heights, default=0.0) * _STEPS + _ROUNDING) / _STEPS


def _above(arm: Arm, height: float) -> float:
    """Share of random configurations in which every link that can be is above a height [m]."""
    a, b = capsule_axes(arm, sampled(arm).T)
    moving = arm.capsules.link >= 0
    low = torch.minimum(a[2], b[2])[moving] - arm.capsules.radius[moving, None]
    clear = low > height
    clear = clear[clear.any(1)]
    return float(clear.all(0).double().mean()) if len(clear) else 0.0
