"""An arm as plain arrays."""

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from sidegan.base.arrays import Array
from sidegan.robot.drives import Drives
from sidegan.robot.setup import PLAIN, Mount, Setup

DERIVATIVE_ORDER = {
    "acceleration": 2,
    "jerk": 3,
}  # what else may be limited: derivatives of the position, by order
LOCKED = "locked "  # how a note on joints that stand still begins

FilePlane = tuple[float, float, float, float]  # unit normal, and the height along it [m]
_FINEST = 2.0**40  # steps per unit: 1e-12, above rounding errors and below any figure that matters


@dataclass(frozen=True, eq=False)
class Pieces:
    """Bodies inside C capsules, each the convex hull of some corners with a ball around each point.

    Where that is the capsule itself, its corners are the ends, and its ball has the capsule's radius.
    """

    corners: Array  # of all pieces, in the frames of their links [m], (V, 3)
    start: Array  # where those of each piece begin, and their number, (C + 1,)
    radius: Array  # of the balls [m], (C,)
    exact: Array  # whether a piece is the capsule itself, (C,) bool
    fitted: Array  # whether capsule and piece were fitted to meshes, (C,) bool
    core: Array  # radius of the capsule on the same axis that has the piece's volume [m], (C,)


@dataclass(frozen=True, eq=False)
class Capsules:
    """Shapes that enclose the links: all points within a radius [m] of a segment."""

    link: Array  # joint in whose frame the end points are given, (C,), 0..J-1; -1 is the base (world frame)
    a: Array  # one end of the segment [m], (C, 3)
    b: Array  # the other end [m], (C, 3); equal to `a` for a sphere
    radius: Array  # radius [m], (C,)
    names: tuple[str, ...]  # what to call each capsule in a message; those of one shape share theirs
    owners: tuple[str, ...]  # the description's link that each is part of
    pieces: Pieces | None = None  # what is inside of them; None where they are the shapes themselves
    points: bool = False  # whether they are points of an arm without shapes, which keep out of regions alone

    @property
    def core(self) -> Array:
        """Radii [m], (C,), that optimisers keep apart: about those of what is inside of the capsules."""
        return self.radius if self.pieces is None else self.pieces.core


@dataclass(frozen=True, eq=False)
class Arm:
    """A serial chain of J revolute and prismatic joints; float64, SI units."""

    name: str  # the name that the description gives it
    digest: str  # sha256 of all the numbers below; neither names nor the path matter
    joint_names: tuple[str, ...]  # from the base outwards
    prismatic: Array  # whether a joint slides, (J,) bool
    # orientation of joint i's frame in joint i-1's (joint 0: in the world) at q = 0, (J, 3, 3)
    rotation: Array
    translation: Array  # origin of the same frame [m], (J, 3)
    axis: Array  # unit vector in the joint's own frame, (J, 3)
    # m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joint's frame, (J, 10)
    inertial_parameters: Array
    position_lower: Array  # [rad or m], (J,)
    position_upper: Array  # [rad or m], (J,)
    velocity_limit: Array  # [rad/s or m/s], (J,)
    torque_limit: Array  # [N·m or N], (J,); infinite where the description states none
    gravity: Array  # [m/s²], (3,), in the world
    capsules: Capsules  # shapes that enclose the links
    urdf: Path  # the file all this was read from
    tip: Array  # the end effector [m], (3,), in the last joint's frame
    link_names: tuple[str, ...]  # of the link that each joint moves
    setup: Setup = PLAIN  # which part of the description this is
    mount: Mount = (0.0, 0.0, 0.0)  # roll, pitch and yaw [rad] of the description's first link in the world
    acceleration_limit: Array | None = None  # [rad/s² or m/s²], (J,); None where nothing states any
    jerk_limit: Array | None = None  # [rad/s³ or m/s³], (J,)
    notes: tuple[str, ...] = ()  # what was locked, lumped and assumed, for people
    # links and the nearest ones with a shape towards the base; None: all that one joint lies between
    parents: frozenset[tuple[str, str]] | None = None
    may_touch: tuple[tuple[str, str, str], ...] = ()  # links that are not kept apart, and who says so
    planes: tuple[FilePlane, ...] = ()  # of the description, such as its floor, in the world
    home: tuple[float, ...] | None = None  # where the description says that it rests [rad or m], (J,)
    drives: Drives | None = None  # friction and rotors that it states, which torque limits are to hold

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return len(self.joint_names)

    @property
    def known_drives(self) -> Drives:
        """Friction and rotors that are known; none where the description states none."""
        return self.drives or Drives.none(self.joints)

    @property
    def higher_limits(self) -> dict[str, Array]:
        """Limits of acceleration and jerk, (J,), where there are any; infinite for joints without one."""
        limits = {"acceleration": self.acceleration_limit, "jerk": self.jerk_limit}
        return {name: x for name, x in limits.items() if x is not None and np.isfinite(x).any()}

    @property
    def locked(self) -> str:
        """Note on the joints that stand still, and where; empty where there are none."""
        return next((note for note in self.notes if note.startswith(LOCKED)), "")

    def named(self, which: Array) -> str:
        """Names of the joints that are marked, (J,), for a message."""
        return ", ".join(name for name, marked in zip(self.joint_names, which.tolist()) if marked)


def with_effort(arm: Arm, effort: float) -> Arm:
    """Arm of whose velocity and torque limits only the share ``effort``, above 0 and up to 1, may be used.

    Limits of acceleration and jerk stay: they are what a controller accepts, whatever the effort.
    """
    if effort == 1:
        return arm
    speed, torque = effort * arm.velocity_limit, effort * arm.torque_limit
    limits = digest_of({"velocity_limit": speed, "torque_limit": torque}, arm.capsules)
    digest = hashlib.sha256(f"{arm.digest} {limits}".encode()).hexdigest()
    return replace(arm, digest=digest, velocity_limit=speed, torque_limit=torque)


def digest_of(numbers: dict[str, Array], capsules: Capsules, more: Sequence[str] = ()) -> str:
    """Sha256 (hex) of an arm's numbers; the same on every machine, as rounding errors do not change it.

    The rounding is to a binary fraction: a decimal figure never lies half-way between two of those, where
    an error in its last bit would decide. Capsules that were fitted to meshes do not count, but the digests
    of the meshes, in ``more``: those are the same wherever they are fitted.
    """
    given = slice(None) if capsules.pieces is None else ~capsules.pieces.fitted
    shapes = {name: getattr(capsules, name)[given] for name in ("a", "b", "link", "radius")}
    state = hashlib.sha256()
    for name, values in sorted((numbers | shapes).items()):
        rounded = np.round(values.astype(float) * _FINEST) / _FINEST + 0.0  # no negative zero
        state.update(f"{name}{values.shape}".encode())
        state.update(rounded.astype("<f8").tobytes())
    for words in more:
        state.update(words.encode())
    return state.hexdigest()
