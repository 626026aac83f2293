"""An arm's kinematics, capsules, hulls and keep-out regions as arrays for kernels."""

from typing import NamedTuple

from sidegan.base.arrays import Array

PLANE, BOX, BALL, CONVEX = range(4)  # kinds of regions


class Chain(NamedTuple):
    """Kinematics of J joints; a joint's rotation in its parent is fixed + sine · sin(q) + cosine · cos(q)."""

    prismatic: Array  # (J,) bool
    fixed: Array  # (J, 9), row by row
    sine: Array  # (J, 9)
    cosine: Array  # (J, 9)
    origin: Array  # origin of the joint's frame in its parent's at q = 0 [m], (J, 3)
    slide: Array  # derivative of that origin in q, (J, 3); zero for revolute joints
    axis: Array  # in the joint's own frame, (J, 3)
    gravity: Array  # [m/s²], (3,)


class Shapes(NamedTuple):
    """C capsules, the pairs to keep apart, and the keep-out regions."""

    frame: Array  # frame of each capsule: 0 for the base, else joint + 1, (C,) int
    ends: Array  # end points of its axis in that frame [m], (2, C, 3)
    radius: Array  # [m], (C,)
    outer: Array  # radius for regions [m], (C,)
    core: Array  # radius for pairs in the optimisers' penalty and in the evaluation [m], (C,)
    size: Array  # slightly more than the radius of its bounding ball [m], (C,)
    pairs: Array  # capsules to keep apart, (P, 2) int
    closer: Array  # allowance added to the distance of each pair [m], (P,)
    guarded: Array  # region and capsule, (K, 2) int
    # normal and offset of a plane, centre and half size of a box, centre and radius of a ball or of a convex
    # body's bounding ball [m]; last, first and end row in ``planes`` of a box or a body, (R, 8)
    regions: Array
    kinds: Array  # kind of each region, (R,) int
    planes: Array  # unit normals and offsets [m] of boxes and convex bodies, (M, 4)


class Hulls(NamedTuple):
    """Bodies inside C capsules: convex hulls of corners, each enlarged by a radius."""

    corners: Array  # in the frames of the capsules [m], (V, 3)
    start: Array  # first corner of each capsule, and V at the end, (C + 1,) int
    radius: Array  # by which the hulls are enlarged [m], (C,)
    around: Array  # largest distance of the corners from the capsule's axis [m], (C,)
    finer: Array  # whether a pair of hulls may be farther apart than its capsules, (P,) bool


class Bodies(NamedTuple):
    """Capsules on the links of an arm, and the hulls inside them."""

    chain: Chain
    shapes: Shapes
    hulls: Hulls
