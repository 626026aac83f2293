"""Compiled distances of an arm's capsules from each other and from keep-out regions, at many positions."""

from sidegan.base.arrays import Array
from sidegan.kernels.bodies import Place, near_pair, place_capsule, place_joints
from sidegan.kernels.chain import Chain, Shapes
from sidegan.kernels.distances import near_region
from sidegan.kernels.jit import kernel
from sidegan.kernels.links import row


@kernel
def clearances(chain: Chain, shapes: Shapes, q: Array, pairs: Array, regions: Array, at: Place) -> None:
    """Write signed distances [m] of capsule pairs, (N, P), and of guarded capsules from regions, (N, K).

    Negative distances are overlaps. Positions [rad or m] are (N, J).
    """
    for n in range(len(q)):
        place_joints(chain, q[n], at)
        for c in range(len(shapes.frame)):
            place_capsule(shapes, c, at)
        for p in range(len(shapes.pairs)):
            pairs[n, p], _, _ = near_pair(shapes, at.ends, p)
        for k in range(len(shapes.guarded)):
            r, c = shapes.guarded[k, 0], shapes.guarded[k, 1]
            height, _, _ = near_region(shapes, r, row(at.ends[0], c), row(at.ends[1], c))
            regions[n, k] = height - shapes.radius[c]
