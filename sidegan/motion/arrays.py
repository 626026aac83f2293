"""Arms as arrays for compiled kernels."""

import numpy as np

from sidegan.base.arrays import Array, flatten
from sidegan.kernels.chain import Chain, Shapes
from sidegan.robot import Arm, Capsules

_ROUNDING = 1e-9  # [m] by which spheres around capsules are enlarged


def chain_of(arm: Arm) -> Chain:
    """The kinematic chain of an arm."""
    eye = np.eye(3)
    slides = arm.prismatic[:, None, None]
    spin = np.linalg.cross(arm.axis[:, :, None], eye[None], axis=1)  # cross-product matrices, (J, 3, 3)
    arrays = [
        arm.prismatic,
        flatten(arm.rotation @ np.where(slides, eye, eye + spin @ spin), 1),
        flatten(np.where(slides, 0.0, arm.rotation @ spin), 1),
        flatten(np.where(slides, 0.0, -arm.rotation @ spin @ spin), 1),
        arm.translation,
        np.where(slides, arm.rotation @ arm.axis[..., None], 0.0)[..., 0],
        arm.axis,
        arm.gravity,
    ]
    return Chain(*map(array, arrays))


def kernel_shapes(
    capsules: Capsules,
    pairs: Array,
    guarded: Array,
    regions: tuple[Array, ...],
    closer: Array | None = None,
    outer: Array | None = None,
) -> Shapes:
    """An arm's capsules, pairs of them, (P, 2), and regions, as ``tables`` has them, for kernels.

    ``guarded``, (K, 2), has a region and the capsule to keep out of it. Pairs may be closer by the distances
    ``closer``, (P,) [m]; None: zero. For regions capsules have radii ``outer``, (C,), at most their own;
    None: their own.
    """
    ends = np.stack([capsules.a, capsules.b])
    radius = capsules.radius
    size = radius + np.linalg.norm(ends[0] - ends[1], axis=1) / 2 + _ROUNDING
    bodies = capsules.link + 1, ends, radius, radius if outer is None else outer, capsules.core, size
    allowed = np.zeros(len(pairs)) if closer is None else closer
    return Shapes(*map(array, (*bodies, pairs, allowed, guarded, *regions)))


def array(x: Array) -> Array:
    """An array for kernels: contiguous, writable, floats in float64."""
    return np.require(x, float if x.dtype.kind == "f" else None, ["C", "W"])
