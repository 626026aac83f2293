"""Units of descriptions: placeholders, angles in degrees, and gears between motors and joints."""

import math
import xml.etree.ElementTree as ET
from collections.abc import Sequence
from contextlib import suppress

import numpy as np

from sidegan.base.arrays import Array
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.thresholds import ENDLESS, FULL_TURN, ROUND_NUMBER


def made_up(size: float, largest: float) -> bool:
    """Whether a limit is a placeholder, such as 1000, or whole half turns, and in no other unit."""
    power = 10.0 ** round(math.log10(size))
    turns = size % 1 != 0 and abs(size / math.pi - round(size / math.pi)) < ROUND_NUMBER
    return size > ENDLESS * largest or abs(size - power) <= ROUND_NUMBER * power or turns


def meant_in_degrees(rpy: tuple[float, ...]) -> list[float]:
    """Roll, pitch and yaw [rad] that were stated in degrees; empty unless one is beyond a turn."""
    return [math.radians(x) for x in rpy] if max(map(abs, rpy)) > FULL_TURN else []


def refuse_angles(root: ET.Element, where: str) -> None:
    """Refuse origins of joints, inertias and collision shapes whose angles look like degrees."""
    wrong = []
    for element in [*root.findall("joint"), *root.findall("link")]:
        inner = [element, *element.findall("inertial"), *element.findall("collision")]
        for origin in [x for part in inner for x in part.findall("origin")]:
            rpy: tuple[float, ...] = (0.0,)
            with suppress(RobotError):  # which whatever reads the element reports
                rpy = xml.vector(origin, "rpy", where, "0 0 0")
            if meant := meant_in_degrees(rpy):
                radians = " ".join(f"{x:.6g}" for x in meant)
                at = f'{element.tag} {element.get("name", "")!r} has rpy="{origin.get("rpy")}"'
                wrong.append(f'{at}: are these degrees? Then write rpy="{radians}"')
    if wrong:
        raise RobotError(f"{where}: {'; '.join(wrong)}; correct the file, and look at its other angles")


def reductions_of(root: ET.Element) -> dict[str, float]:
    """Gear reductions above 1 that transmissions of single joints state, by joint."""
    names = [x.get("name", "") for x in root.findall("joint")]
    matrix = np.abs(transmissions(root, names))
    alone = (np.count_nonzero(matrix, 0) == 1) & (np.count_nonzero(matrix, 1) == 1)
    return {name: float(1 / x.max()) for name, x, one in zip(names, matrix, alone) if one and x.max() < 1}


def transmissions(root: ET.Element, joint_names: Sequence[str]) -> Array:
    """Matrix, (J, J), of joints' positions from their motors', as transmissions of ros_control state it."""
    matrix = np.eye(len(joint_names))
    for element in root.iter("transmission"):
        joints = sorted(element.findall("joint"), key=_role)
        motors = sorted(element.findall("actuator"), key=_role)
        at = [joint_names.index(name) for x in joints if (name := x.get("name", "")) in joint_names]
        gears, drives = [*map(_reduction, joints)], [*map(_reduction, motors)] or [1.0] * len(joints)
        kind = element.findtext("type", "") + element.findtext("plugin", "")
        shape = np.eye(len(joints))
        if "Differential" in kind and len(joints) == 2:
            shape = np.array([[0.5, 0.5], [0.5, -0.5]])
        elif "FourBar" in kind and len(joints) == 2:
            shape[1, 0] = -1 / gears[0]
        if len(at) == len(joints) == len(drives):
            matrix[np.ix_(at, at)] = shape / np.outer(gears, drives)
    return matrix


def _role(element: ET.Element) -> str:
    """The role of a joint or a motor in a transmission, such as joint1."""
    return element.get("role", "") + element.findtext("role", "")


def _reduction(element: ET.Element) -> float:
    """The gear reduction that a part of a transmission states; 1 if none."""
    tags = "mechanicalReduction", "mechanical_reduction"
    return next((x for tag in tags if (x := xml.number_or_zero(element.findtext(tag)))), 1.0)
