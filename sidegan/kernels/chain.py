"""An arm's kinematics, and its capsules among what they must not touch, as the arrays that kernels take."""

from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidegan.robot import Arm, Capsules

Array = np.ndarray

PLANE, BOX, BALL, CONVEX = range(4)  # kinds of regions
_ROUNDING = 1e-9  # [m] by which the balls around capsules are larger than they need be


class Chain(NamedTuple):
    """Placements of J joints; a joint's rotation in its parent is fixed + sine · sin(q) + cosine · cos(q)."""

    prismatic: Array  # whether a joint slides, (J,) bool
    fixed: Array  # (J, 9), row by row
    sine: Array  # (J, 9)
    cosine: Array  # (J, 9)
    origin: Array  # of the joint's frame in its parent's at q = 0 [m], (J, 3)
    slide: Array  # how that origin moves with q, (J, 3); zero where the joint turns
    axis: Array  # in the joint's own frame, (J, 3)
    gravity: Array  # [m/s²], (3,)

    @classmethod
    def of(cls, arm: Arm) -> "Chain":
        """The chain of an arm."""
        eye, slides = torch.eye(3, dtype=torch.float64), arm.prismatic[:, None, None]
        spin = torch.linalg.cross(arm.axis[:, :, None], eye[None], dim=1)  # of a unit turn, (J, 3, 3)
        tensors = [
            arm.prismatic,
            (arm.rotation @ torch.where(slides, eye, eye + spin @ spin)).flatten(1),
            torch.where(slides, 0.0, arm.rotation @ spin).flatten(1),
            torch.where(slides, 0.0, -arm.rotation @ spin @ spin).flatten(1),
            arm.translation,
            torch.where(slides, arm.rotation @ arm.axis[..., None], 0.0)[..., 0],
            arm.axis,
            arm.gravity,
        ]
        return cls(*map(array, tensors))


class Shapes(NamedTuple):
    """C capsules, and what they are kept apart from."""

    frame: Array  # in which a capsule lies: 0 for the base, else joint + 1, (C,) int
    ends: Array  # of its axis, in that frame [m], (2, C, 3)
    radius: Array  # [m], (C,)
    core: Array  # radius that optimisers keep apart [m], (C,)
    size: Array  # a little more than the radius of the ball around it [m], (C,)
    balls: Array  # centre and radius of a ball around each frame's capsules, in that frame [m], (F, 4)
    pairs: Array  # capsules that are kept apart, (P, 2) int
    guarded: Array  # region and capsule, (K, 2) int
    # normal and offset of a plane, centre and half size of a box, centre and radius of a ball, or of one
    # around a convex body [m]; last where the planes of a box or a body begin and end, (R, 8)
    regions: Array
    kinds: Array  # of the regions, (R,) int
    planes: Array  # unit normals and offsets [m] of boxes and convex bodies, (M, 4)

    @classmethod
    def of(cls, capsules: Capsules, pairs: Tensor, guarded: Tensor, regions: tuple[Tensor, ...]) -> "Shapes":
        """Shapes of an arm's capsules and of regions: their numbers (R, 8), kinds (R,) and planes (M, 4)."""
        ends, radius = torch.stack([capsules.a, capsules.b]), capsules.radius
        size = radius + (ends[0] - ends[1]).norm(dim=1) / 2 + _ROUNDING
        balls = _balls(capsules.link + 1, ends, radius)
        bodies = capsules.link + 1, ends, radius, capsules.core, size, balls
        return cls(*map(array, (*bodies, pairs, guarded, *regions)))


def _balls(frame: Tensor, ends: Tensor, radius: Tensor) -> Tensor:
    """Balls (F, 4) around the capsules of each frame; of no size where there are none."""
    balls = torch.zeros(int(frame.max()) + 1 if len(frame) else 0, 4, dtype=torch.float64)
    for f in torch.unique(frame).tolist():
        some = ends[:, frame == f]
        balls[f, :3] = (some.amin((0, 1)) + some.amax((0, 1))) / 2
        balls[f, 3] = ((some - balls[f, :3]).norm(dim=2) + radius[frame == f]).max() + _ROUNDING
    return balls


def array(x: Tensor) -> Array:
    """A tensor's numbers, contiguous, without gradient."""
    return x.detach().contiguous().numpy()
