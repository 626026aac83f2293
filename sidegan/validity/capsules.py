"""Distances of an arm's capsules and of the convex pieces inside, and how fast they change at most."""

import math
from dataclasses import replace
from functools import lru_cache

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import ShapeError
from sidegan.kernels.chain import Bodies, Chain, Hulls, Shapes
from sidegan.motion.arrays import array, chain_of, kernel_shapes
from sidegan.robot import Arm
from sidegan.robot.fitting import from_segment
from sidegan.validity.regions import tables

_BUDGET = (100_000, 20_000, 2_000)  # boxes for a pair with one, two, and more joints between them
_DEPTH = 512  # most boxes in the queue
_GAP = 1e-6  # [m] least distance to prove, far above rounding errors


def place_points(arm: Arm, q: Array, points: Array, links: Array) -> Array:
    """World positions [m], (3, K, N), of points (K, 3) fixed to links (K,), -1 for the base, at (J, N)."""
    fixed, sine, cosine, origin, slide = (x[..., None] for x in chain_of(arm)[1:6])
    turns = [np.broadcast_to(np.eye(3)[..., None], (3, 3, q.shape[1]))]
    places = [np.zeros((3, q.shape[1]))]
    for i, x in enumerate(q):
        turn = (fixed[i] + sine[i] * np.sin(x) + cosine[i] * np.cos(x)).reshape(3, 3, -1)
        places.append(places[-1] + (turns[-1] * (origin[i] + slide[i] * x)).sum(1))
        turns.append((turns[-1][:, :, None] * turn).sum(1))
    own = np.stack(turns)[links + 1], np.stack(places)[links + 1]  # of each point's frame
    return np.einsum("kijn,kj->ikn", own[0], points) + own[1].swapaxes(0, 1)


def capsule_clearances(chain: Chain, shapes: Shapes, q: Array) -> tuple[Array, Array]:
    """Signed distances [m] of capsule pairs, (N, P), and of guarded ones from regions, (N, K), at (N, J).

    Distances of two nearly coincident segments are accurate to 1e-7 of a length in the worst case.

    Raises:
        ShapeError: when the positions are not (N, J).
    """
    from sidegan.kernels import bodies as kernel

    joints = len(chain.prismatic)
    if q.shape[1:] != (joints,):
        raise ShapeError(f"positions are {q.shape}, expected (N, {joints})")
    pairs, regions = (np.empty((len(q), len(x))) for x in (shapes.pairs, shapes.guarded))
    kernel.signed_distances(chain, shapes, array(q), pairs, regions, kernel.pose_for(shapes, joints))
    return pairs, regions


def capsule_distances(arm: Arm, q: Array, pairs: Array) -> Array:
    """Signed distances [m], (N, P), of pairs of capsules (P, 2) at positions (N, J)."""
    return capsule_clearances(chain_of(arm), shapes_alone(arm, pairs), q)[0]


def shapes_alone(arm: Arm, pairs: Array) -> Shapes:
    """Capsules and pairs of them, (P, 2), without regions, for compiled kernels."""
    return kernel_shapes(arm.capsules, pairs, np.zeros((0, 2), dtype=int), tables(()))


@lru_cache(maxsize=16)
def thicker(arm: Arm, clearance: float) -> Arm:
    """The arm with its shapes inflated by half a clearance [m]; the arm itself for zero."""
    if not clearance:
        return arm
    radii = {name: getattr(arm.capsules, name) + clearance / 2 for name in ("radius", "rounding", "core")}
    return replace(arm, capsules=replace(arm.capsules, **radii))


def reaches(arm: Arm, pairs: Array, guarded: Array) -> tuple[Array, Array, Array]:
    """Largest change of distances per joint motion [m per rad or m].

    Of pairs of capsules (P, 2), and of the pieces inside them, (P, J) each; and of regions and capsules
    (K, 2), (K, J). For two capsules only the joints between their links count; these move the outer one.
    """
    link = arm.capsules.link
    reach = _reach(arm, [*np.stack([arm.capsules.a, arm.capsules.b], 1)])
    inner = _reach(arm, arm.capsules.hulls)
    first, second = link[pairs].T
    outer = np.where(first > second, pairs[:, 0], pairs[:, 1])
    joints = np.arange(arm.joints)
    far = np.maximum(first, second)[:, None]
    between = (joints[None] > np.minimum(first, second)[:, None]) & (joints[None] <= far)
    return reach[outer] * between, inner[outer] * between, reach[guarded[:, 1]]


def travel(arm: Arm) -> Array:
    """Upper bound of the distance [m] between a joint's frame and its parent's, (J,)."""
    slide = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    return np.linalg.norm(arm.translation, axis=1) + np.where(arm.prismatic, slide, 0.0)


def _reach(arm: Arm, bodies: list[Array]) -> Array:
    """Largest speed of the corners (V, 3) of each body per unit joint speed [m per rad or m], (C, J).

    A point's distance from a joint's axis is at most that of the next joint's origin, which rotation about
    the axis does not change, plus the lengths from there outwards.
    """
    travels = travel(arm)
    reach = np.zeros((len(bodies), arm.joints))
    for k, (link, corners) in enumerate(zip(arm.capsules.link.tolist(), bodies)):
        for j in range(link + 1):
            if arm.prismatic[j]:
                reach[k, j] = 1.0
            elif j == link:
                reach[k, j] = _from_axis(arm, j, corners).max()
            else:
                step = travels[j + 1] if arm.prismatic[j + 1] else _from_axis(arm, j, arm.translation[j + 1])
                reach[k, j] = step + travels[j + 2 : link + 1].sum() + np.linalg.norm(corners, axis=1).max()
    return reach


def _from_axis(arm: Arm, joint: int, points: Array) -> Array:
    """Distance [m] of points (…, 3) from a joint's axis, (…)."""
    return np.linalg.norm(np.linalg.cross(arm.axis[joint], points), axis=-1)


def bodies_of(arm: Arm, shapes: Shapes) -> Bodies:
    """An arm's capsules, pairs and regions with the pieces inside the capsules, for compiled kernels."""
    capsules = arm.capsules
    each = zip(capsules.a, capsules.b, capsules.hulls)
    around = np.array([from_segment(np.stack([a, b]), corners).max() for a, b, corners in each])
    finer = ~np.all(capsules.exact[shapes.pairs], 1)
    hulls = Hulls(*map(array, (capsules.corners, capsules.start, capsules.rounding, around, finer)))
    return Bodies(chain_of(arm), shapes, hulls)


def piece_distances(bodies: Bodies, q: Array, asked: Array, need: float = math.inf) -> Array:
    """Lower bounds of distances [m], (M,), accurate to 1e-8 m; minus infinity where pieces touch.

    Like those of capsules, they are larger by what a pair may be closer; above ``need`` [m] they need not be
    accurate. ``asked``, (M, 2), has the row of q, (N, J) [rad or m], ascending, and the pair of each.
    """
    from sidegan.kernels import bodies as kernel

    found = np.empty(len(asked))
    if len(asked):
        room = kernel.pose_for(bodies.shapes, q.shape[1])
        kernel.distances(bodies, array(q), array(asked), need, found, room)
    return found


def never_touching(arm: Arm, pairs: Array) -> Array:
    """Whether pairs of capsules, (P, 2), provably never touch within the joint limits, (P,) bool.

    Branch and bound over boxes of joint positions, with the same motion bounds as the check of
    trajectories. Not for arms of exact capsules alone; pairs for which the proof takes too long may touch.
    """
    from sidegan.kernels import bodies as kernel

    found = np.zeros(len(pairs), bool)
    if not len(pairs) or arm.capsules.exact.all():
        return found
    bodies = bodies_of(arm, shapes_alone(arm, pairs))
    reach = array(reaches(arm, pairs, pairs[:0])[1])
    link = arm.capsules.link[pairs]
    work = np.empty((2, _DEPTH, arm.joints))
    room = kernel.pose_for(bodies.shapes, arm.joints)
    for p, joints in enumerate(np.abs(link[:, 0] - link[:, 1]).tolist()):
        work[0, 0] = (arm.position_upper + arm.position_lower) / 2
        work[1, 0] = (arm.position_upper - arm.position_lower) / 2
        budget = _BUDGET[min(joints, len(_BUDGET)) - 1]
        found[p] = kernel.never_touch(bodies, reach, p, _GAP, work, budget, room)
    return found
