"""An arm as plain arrays."""

import hashlib
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array, numbers
from sidegan.errors import ConfigError, ShapeError
from sidegan.robot.drives import Drives
from sidegan.robot.setup import PLAIN, Mount, Setup

DERIVATIVE_ORDER = {"acceleration": 2, "jerk": 3}  # of the position, which may be limited
LOCKED = "locked "  # start of a note on locked joints
NO_INERTIA = "no inertia: "  # start of a note on missing inertias

FilePlane = tuple[float, float, float, float]  # unit normal, and the height along it [m]
_FINEST = 2.0**40  # steps per unit of rounded numbers: 1e-12, above errors and below significant figures


@dataclass(frozen=True, eq=False)
class Capsules:
    """C capsules that enclose the links, all points within a radius [m] of a segment, and the pieces inside.

    A piece is a convex hull, inflated by a radius. If the capsule is the exact shape, they are the same: the
    corners of the hull are the segment's ends.
    """

    link: Array  # joint in whose frame the capsule is given, (C,), 0..J-1; -1 is the base (world frame)
    a: Array  # one end of the segment [m], (C, 3)
    b: Array  # the other end [m], (C, 3); equal to `a` for a sphere
    radius: Array  # radius [m], (C,)
    owners: tuple[str, ...]  # the description's link that each belongs to
    corners: Array  # of all pieces, in the frames of their links [m], (V, 3)
    start: Array  # index of each piece's first corner, and the number of corners, (C + 1,)
    rounding: Array  # radius by which the hulls are inflated [m], (C,)
    core: Array  # radius [m] with the piece's volume on the same axis, for optimisers' penalties, (C,)
    exact: Array  # whether a capsule is the piece itself, (C,) bool
    fitted: Array  # whether capsule and piece were fitted to meshes, (C,) bool
    points: int = 0  # number of the last ones that are points of links without shapes, used for regions only

    @property
    def hulls(self) -> list[Array]:
        """Corners of each piece's hull, (V, 3)."""
        return [self.corners[first:end] for first, end in pairwise(self.start.tolist())]

    @property
    def shaped(self) -> Array:
        """Whether each is a shape, not a point, (C,)."""
        return np.arange(len(self.link)) < len(self.link) - self.points

    @property
    def only_points(self) -> bool:
        """Whether all that moves is points."""
        return 0 < self.points == np.count_nonzero(self.link >= 0)


@dataclass(frozen=True, eq=False)
class MotionLimits:
    """The limits of an arm's J joints that are linear in a motion."""

    name: str  # of the arm in its description
    digest: str  # sha256 of all the arm's numbers, without names and paths
    position_lower: Array  # [rad or m], (J,)
    position_upper: Array  # [rad or m], (J,)
    velocity_limit: Array  # [rad/s or m/s], (J,)
    # [rad/s² or m/s²] and [rad/s³ or m/s³], (J,); None if there is none
    acceleration_limit: Array | None = field(default=None, kw_only=True)
    jerk_limit: Array | None = field(default=None, kw_only=True)

    @property
    def joints(self) -> int:
        """Number of joints J."""
        return len(self.velocity_limit)

    @property
    def higher_limits(self) -> dict[str, Array]:
        """Limits on acceleration and jerk, (J,), if there are any; infinite for joints without one."""
        limits = {"acceleration": self.acceleration_limit, "jerk": self.jerk_limit}
        return {name: x for name, x in limits.items() if x is not None and np.isfinite(x).any()}


@dataclass(frozen=True, eq=False)
class Arm(MotionLimits):
    """A serial chain of J revolute and prismatic joints; float64, SI units."""

    joint_names: tuple[str, ...]  # from the base outwards
    prismatic: Array  # whether each joint is prismatic, (J,) bool
    # orientation of joint i's frame in joint i-1's (joint 0: in the world) at q = 0, (J, 3, 3)
    rotation: Array
    translation: Array  # origin of the same frame [m], (J, 3)
    axis: Array  # unit vector in the joint's own frame, (J, 3)
    # m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joint's frame, (J, 10)
    inertial_parameters: Array
    torque_limit: Array  # [N·m or N], (J,); infinite where there is none
    gravity: Array  # [m/s²], (3,), in the world
    capsules: Capsules
    urdf: Path  # the description's file, of any format
    tip: Array  # the end effector [m], (3,), in the last joint's frame
    link_names: tuple[str, ...]  # link that each joint moves
    setup: Setup = PLAIN  # the user's choices
    mount: Mount = (0.0, 0.0, 0.0)  # roll, pitch and yaw [rad] of the description's first link in the world
    notes: tuple[str, ...] = ()  # for people, on what was locked, lumped and assumed
    # links, each with its nearest ancestor that has a shape; None: all links with one joint between them
    parents: frozenset[tuple[str, str]] | None = None
    # pairs of links not checked for collision, and the source
    may_touch: tuple[tuple[str, str, str], ...] = ()
    planes: tuple[FilePlane, ...] = ()  # of the description, such as a floor, in the world
    home: tuple[float, ...] | None = None  # the description's home position [rad or m], (J,)
    drives: Drives | None = None  # the description's friction and rotors, which count in torques

    @property
    def known_drives(self) -> Drives:
        """Friction and rotors, zero unless the description states them."""
        return self.drives or Drives.none(self.joints)

    @property
    def locked(self) -> str:
        """Note on locked joints and their positions; empty if there are none."""
        return next((note for note in self.notes if note.startswith(LOCKED)), "")

    @property
    def massless(self) -> list[str]:
        """Why inertias are missing, as far as the description tells."""
        return [note.removeprefix(NO_INERTIA) for note in self.notes if note.startswith(NO_INERTIA)]

    def unlike(self, robot: str, digest: str) -> str:
        """End of a message on what was made for another arm, of this name and digest, not for this one."""
        return (
            f"{robot} (digest {digest[:12]}), not for {self.name} (digest {self.digest[:12]}), "
            "whose description, limits or share of them (effort) differ"
        )

    def named(self, which: Array) -> str:
        """Names of the marked joints, (J,), for a message."""
        return ", ".join(name for name, marked in zip(self.joint_names, which.tolist()) if marked)


def with_effort(arm: Arm, effort: float) -> Arm:
    """The arm with its velocity and torque limits scaled by ``effort``, above 0 and up to 1.

    Limits on acceleration and jerk are not scaled: they are what a controller accepts, whatever the effort.

    Raises:
        ConfigError: when the effort is not a share in (0, 1], such as a percentage.
    """
    if not (isinstance(effort, int | float) and 0 < effort <= 1):
        raise ConfigError(f"effort is {effort!r}, expected a share above 0 and up to 1")
    if effort == 1:
        return arm
    speed, torque = effort * arm.velocity_limit, effort * arm.torque_limit
    limits = digest_of({"velocity_limit": speed, "torque_limit": torque}, arm.capsules)
    digest = hashlib.sha256(f"{arm.digest} {limits}".encode()).hexdigest()
    return replace(arm, digest=digest, velocity_limit=speed, torque_limit=torque)


def states_of(joints: int, *given: ArrayLike) -> list[Array]:
    """Positions, velocities and accelerations as arrays, (S, J) each.

    Raises:
        ShapeError: when they have other or different shapes.
    """
    states = [numbers(x, "states") for x in given]
    if {x.shape for x in states} != {(*states[0].shape[:1], joints)}:
        shapes = ", ".join(str(x.shape) for x in states)
        raise ShapeError(f"states are {shapes}, expected (S, {joints}), all three alike")
    return states


def length_of(fields: Mapping[str, Any]) -> float:
    """Approximate reach of an arm from its first joint [m]; ``fields`` has arrays named as in `Arm`.

    The last link counts up to its tip, or by the median distance of all links' centres of mass from their
    joints, if that is larger.
    """
    mass = np.maximum(fields["inertial_parameters"][:, 0], 1e-9)
    centres = np.linalg.norm(fields["inertial_parameters"][:, 1:4], axis=1) / mass
    slides = np.where(fields["prismatic"], fields["position_upper"] - fields["position_lower"], 0.0)
    offsets = np.linalg.norm(fields["translation"][1:], axis=1).sum() + slides.sum()
    return float(offsets + max(np.linalg.norm(fields["tip"]), np.median(centres)))


def rounded(numbers: Array) -> bytes:
    """Numbers as bytes for a digest, rounded so that they are the same on every machine.

    Rounding is to binary fractions, since no decimal figure lies half-way between two of these, where its
    last bit would decide.
    """
    whole = np.round(numbers.astype(float) * _FINEST) / _FINEST + 0.0  # no negative zero
    return whole.astype("<f8").tobytes()


def digest_of(numbers: dict[str, Array], capsules: Capsules, extra: Sequence[str] = ()) -> str:
    """Sha256 (hex) of an arm's numbers, the same on every machine.

    Capsules fitted to meshes do not count, as they vary between machines; ``extra`` has the digests of the
    meshes instead.
    """
    shapes = {name: getattr(capsules, name)[~capsules.fitted] for name in ("a", "b", "link", "radius")}
    state = hashlib.sha256()
    for name, values in sorted((numbers | shapes).items()):
        state.update(f"{name}{values.shape}".encode())
        state.update(rounded(values))
    for words in extra:
        state.update(words.encode())
    return state.hexdigest()
