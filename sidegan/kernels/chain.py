"""An arm's kinematics, and its capsules among what they must not touch, as the arrays that kernels take."""

from typing import NamedTuple

from sidegan.base.arrays import Array

PLANE, BOX, BALL, CONVEX = range(4)  # kinds of regions


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


class Shapes(NamedTuple):
    """C capsules, and what they are kept apart from."""

    frame: Array  # in which a capsule lies: 0 for the base, else joint + 1, (C,) int
    ends: Array  # of its axis, in that frame [m], (2, C, 3)
    radius: Array  # [m], (C,)
    core: Array  # radius that optimisers keep apart [m], (C,)
    size: Array  # a little more than the radius of the ball around it [m], (C,)
    pairs: Array  # capsules that are kept apart, (P, 2) int
    closer: Array  # how much nearer than their radii say these may come [m], (P,)
    guarded: Array  # region and capsule, (K, 2) int
    # normal and offset of a plane, centre and half size of a box, centre and radius of a ball, or of one
    # around a convex body [m]; last where the planes of a box or a body begin and end, (R, 8)
    regions: Array
    kinds: Array  # of the regions, (R,) int
    planes: Array  # unit normals and offsets [m] of boxes and convex bodies, (M, 4)
