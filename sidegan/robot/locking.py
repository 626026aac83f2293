"""Locking of joints at a position, and placements in URDF."""

import math
import xml.etree.ElementTree as ET

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.tree import TURNING, Joint

_AXIS = (1e-6, 1e6)  # lengths of an axis that can be normalised
_TURN = 2.02 * math.pi  # [rad] beyond which an angle must be in degrees
Matrix = NDArray[np.float64]


def unit_axis(joint: Joint, at: str) -> Matrix:
    """Unit vector along a joint's axis, (3,)."""
    axis = xml.vector(joint.element.find("axis"), "xyz", at, "1 0 0")
    length = math.hypot(*axis)
    if not _AXIS[0] <= length <= _AXIS[1]:
        words = " ".join(f"{x:g}" for x in axis)
        raise RobotError(f"{at} has the axis {words}, expected a direction, of about unit length")
    return np.array(axis) / length


def lock(joint: Joint, value: float, at: str) -> None:
    """Make a joint fixed at a position [rad or m], or at its origin if it is planar or floating."""
    element = joint.element
    if value and joint.kind in (*TURNING, "prismatic"):
        axis = unit_axis(joint, at)
        origin = element.find("origin")
        place = np.array(xml.vector(origin, "xyz", at, "0 0 0"))
        turn = from_rpy(xml.vector(origin, "rpy", at, "0 0 0"))
        if joint.kind == "prismatic":
            place = place + turn @ axis * value
        else:
            turn = turn @ pin.exp3(value * axis)
        if origin is None:
            origin = ET.SubElement(element, "origin")
        write_placement(origin, turn, place)
    element.set("type", "fixed")
    for tag in ("mimic", "limit", "axis", "safety_controller", "dynamics", "calibration"):
        for extra in element.findall(tag):
            element.remove(extra)


def write_placement(origin: ET.Element, turn: Matrix, place: Matrix) -> None:
    """Write a rotation (3, 3) and a translation [m], (3,), into a URDF's origin."""
    origin.set("xyz", xml.words(place))
    origin.set("rpy", xml.words(pin.rpy.matrixToRpy(turn)))


def meant_in_degrees(rpy: tuple[float, ...]) -> list[float]:
    """Roll, pitch and yaw [rad] that were stated in degrees; empty unless one is beyond a turn."""
    return [math.radians(x) for x in rpy] if max(map(abs, rpy)) > _TURN else []


def from_rpy(rpy: tuple[float, ...]) -> Matrix:
    """Rotation (3, 3) from roll, pitch and yaw [rad]."""
    return pin.rpy.rpyToMatrix(*rpy)
