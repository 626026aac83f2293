"""Placements: locking of joints at a position, and mounting of an arm in the world, whose z points up."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence

import numpy as np
import pinocchio as pin

from sidegan.base.arrays import Array
from sidegan.base.settings_text import setting_name, suggestion
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.arm import Arm, FilePlane
from sidegan.robot.setup import Mount
from sidegan.robot.thresholds import UPRIGHT
from sidegan.robot.tree import MOVABLE, UrdfJoint
from sidegan.robot.units import meant_in_degrees

GRAVITY = 9.81  # [m/s²]
_AXIS = (1e-6, 1e6)  # lengths of an axis that can be normalised
_WORLD = "sidegan_world"
_STRAIGHT = 0.05  # [rad] within which a direction is taken for an axis
_ROUNDING = 1e-9


def unit_axis(joint: UrdfJoint) -> Array:
    """Unit vector along a joint's axis, (3,)."""
    stated = joint.element.find("axis")
    axis = (1.0, 0.0, 0.0) if stated is None else xml.vector(stated, "xyz", joint.at)
    length = math.hypot(*axis)
    if not _AXIS[0] <= length <= _AXIS[1]:
        words = " ".join(f"{x:g}" for x in axis)
        raise RobotError(f"{joint.at} has the axis {words}, expected a direction, of about unit length")
    return np.array(axis) / length


def lock(joint: UrdfJoint, value: float) -> None:
    """Make a joint fixed at a position [rad or m], or at its origin if it is planar or floating."""
    element = joint.element
    if value and joint.kind in MOVABLE:
        axis = unit_axis(joint)
        xyz, rpy = xml.origin(element, joint.at)
        place, turn = np.array(xyz), from_rpy(rpy)
        if joint.slides:
            place = place + turn @ axis * value
        else:
            turn = turn @ pin.exp3(value * axis)
        origin = element.find("origin")
        write_placement(ET.SubElement(element, "origin") if origin is None else origin, turn, place)
    element.set("type", "fixed")
    for tag in ("mimic", "limit", "axis", "safety_controller", "dynamics", "calibration"):
        for extra in element.findall(tag):
            element.remove(extra)


def write_placement(origin: ET.Element, turn: Array, place: Array) -> None:
    """Write a rotation (3, 3) and a translation [m], (3,), into a URDF's origin."""
    origin.set("xyz", xml.words(place))
    origin.set("rpy", xml.words(pin.rpy.matrixToRpy(turn)))


def from_rpy(rpy: tuple[float, ...]) -> Array:
    """Rotation (3, 3) from roll, pitch and yaw [rad]."""
    return pin.rpy.rpyToMatrix(*rpy)


def mount_of(given: Mount | None, gravity: Sequence[float] | None = None) -> Mount:
    """Roll, pitch and yaw [rad] of a base: as given, or such that gravity (3,), in its frame, points down.

    Raises:
        RobotError: when angles look like degrees.
    """
    if given is not None and (meant := meant_in_degrees(given)):
        name, stated = setting_name("robot.mount"), suggestion("robot.mount", meant, ".6g")
        raise RobotError(f"{name} is {list(given)} rad: are these degrees? In radians they are {stated}")
    if given is not None or gravity is None:
        return given or (0.0, 0.0, 0.0)
    x, y, z = gravity
    size = math.hypot(x, y, z)
    if size == 0:
        return 0.0, 0.0, 0.0
    roll = math.atan2(-y, -z) if math.hypot(y, z) > _ROUNDING * size else 0.0
    return roll + 0.0, math.asin(x / size), 0.0


def hang(root: ET.Element, base: str, mount: Mount) -> None:
    """Fix a description's first link to the world with this roll, pitch and yaw [rad]."""
    ET.SubElement(root, "link", name=_WORLD)
    joint = ET.SubElement(root, "joint", name=f"{_WORLD}_joint", type="fixed")
    ET.SubElement(joint, "parent", link=_WORLD)
    ET.SubElement(joint, "child", link=base)
    ET.SubElement(joint, "origin", xyz="0 0 0", rpy=xml.words(mount))


def rotate_planes(planes: Sequence[FilePlane], mount: Mount) -> tuple[FilePlane, ...]:
    """Planes transformed from the base's frame to the world, for a mount [rad]."""
    turn = from_rpy(mount)
    return tuple((*(turn @ np.array(normal)).tolist(), offset) for *normal, offset in planes)


def stands(arm: Arm) -> bool:
    """Whether an arm's base is upright, not hanging or on a wall."""
    return float(from_rpy(arm.mount)[2, 2]) >= UPRIGHT


def in_base(arm: Arm, vector: Array) -> Array:
    """A world vector (3,), in the frame of an arm's base."""
    return from_rpy(arm.mount).T @ vector


def straightened(vector: Array) -> Array:
    """A vector (3,), aligned with an axis of its frame if it nearly is."""
    k = int(np.abs(vector).argmax())
    along = np.zeros_like(vector)
    along[k] = np.sign(vector[k]) * np.linalg.norm(vector)
    return along if float(np.abs(vector)[k]) > math.cos(_STRAIGHT) * float(np.linalg.norm(vector)) else vector


def describe_direction(vector: Array) -> str:
    """Direction of a vector (3,), for people: an axis, or a unit vector."""
    if int((vector != 0).sum()) == 1:
        k = int(np.abs(vector).argmax())
        return f"{'+' if vector[k] > 0 else '−'}{'xyz'[k]}"
    return f"({', '.join(f'{round(x, 2) + 0.0:.2f}' for x in (vector / np.linalg.norm(vector)).tolist())})"
