"""Floor and planes of an arm's description, and points that stand for links without shapes."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from sidegan.base.arrays import Array
from sidegan.motion.arrays import chain_of, kernel_shapes
from sidegan.robot import Arm, Capsules
from sidegan.robot.foot import foot, like_the_arm
from sidegan.robot.placement import stands
from sidegan.validity.capsules import capsule_clearances
from sidegan.validity.pairs import random_configurations
from sidegan.validity.regions import Plane, tables
from sidegan.validity.thresholds import STANDING_SHARE

_STEPS = 1_000  # per metre: heights are rounded down to whole millimetres
_STEP_ROUNDING = 1e-3  # of a step, for rounding errors


@lru_cache(maxsize=16)
def floor_under(arm: Arm) -> Plane | None:
    """The floor that an arm stands on, from the shapes of its base.

    None if the arm does not stand upright or reaches below its base in nearly every configuration, or if the
    lowest point is on another limb like it, which is locked somewhere.
    """
    lowest, _, link = foot(arm)
    floor = Plane((0.0, 0.0, 1.0), math.floor(lowest * _STEPS + _STEP_ROUNDING) / _STEPS)
    limb = bool(link) and like_the_arm(arm, link)
    return floor if stands(arm) and not limb and _leaves(arm, floor) else None


def floor_is_known(arm: Arm) -> bool:
    """Whether an arm's floor follows from shapes, rather than being a guess."""
    return foot(arm)[1]


@lru_cache(maxsize=16)
def planes_of(arm: Arm) -> tuple[list[Plane], int]:
    """Planes of an arm's description, and the number of ignored ones, which it is nearly always behind."""
    planes = [Plane((x, y, z), offset) for x, y, z, offset in arm.planes]
    kept = [plane for plane in planes if _leaves(arm, plane)]
    return kept, len(planes) - len(kept)


@lru_cache(maxsize=16)
def with_points(arm: Arm) -> Arm:
    """The arm, with points for moving links without a shape: origins of the joints at both ends, or the tip.

    The origin of the first joint does not move and is left out.
    """
    bare = ~np.isin(np.arange(arm.joints), arm.capsules.link)
    if not bare.any():
        return arm
    link = np.flatnonzero(bare | np.append(bare[1:], False))  # whose outer end is an end of a bare one
    places = np.stack([*arm.translation[1:], arm.tip])[link]
    names = (*arm.joint_names[1:], "the tip")
    return replace(arm, capsules=_added(arm.capsules, link, places, [names[k] for k in link]))


def _added(shapes: Capsules, link: Array, places: Array, owners: list[str]) -> Capsules:
    """Capsules, and points on links (N,) at places (N, 3) [m]."""
    none = np.zeros(len(link))
    return Capsules(
        link=np.append(shapes.link, link),
        a=np.concatenate([shapes.a, places]),
        b=np.concatenate([shapes.b, places]),
        radius=np.append(shapes.radius, none),
        owners=(*shapes.owners, *owners),
        corners=np.concatenate([shapes.corners, places]),
        start=np.append(shapes.start, shapes.start[-1] + 1 + np.arange(len(link))),
        rounding=np.append(shapes.rounding, none),
        core=np.append(shapes.core, none),
        exact=np.append(shapes.exact, none == 0),
        fitted=np.append(shapes.fitted, none > 0),
        points=len(link),
    )


def _leaves(arm: Arm, plane: Plane) -> bool:
    """Whether all links that can be in front of a plane are so in enough random configurations."""
    arm = with_points(arm)
    moving = np.flatnonzero(arm.capsules.link >= 0)
    guarded = np.stack([np.zeros_like(moving), moving], 1)
    shapes = kernel_shapes(arm.capsules, guarded[:0], guarded, tables([plane]))
    clear = capsule_clearances(chain_of(arm), shapes, random_configurations(arm))[1] > 0  # (N, K)
    clear = clear[:, clear.any(0)]
    return clear.size > 0 and float(clear.all(1).mean()) >= STANDING_SHARE
