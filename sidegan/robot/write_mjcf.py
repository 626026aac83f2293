"""An arm as MJCF: its chain of links with explicit inertias, its joints with friction and rotors."""

import logging
import xml.etree.ElementTree as ET
from collections.abc import Iterable, Sequence
from pathlib import Path

import scipy  # its parts are imported when they are used
import torch
from torch import Tensor

from sidegan.base.storage import write_bytes
from sidegan.errors import RobotError
from sidegan.robot.arm import Arm
from sidegan.robot.consistency import about_the_centre, require_consistent
from sidegan.robot.drives import Drives
from sidegan.robot.mujoco_log import mujoco_logged
from sidegan.robot.xml import words

_STEP = 1e-3  # [s] of a written model
_STIFFEST = 2.0  # steps: the shortest time constant with which MuJoCo solves friction
_WORLD = "world"  # MuJoCo's own name for what does not move


def write_mjcf(arm: Arm, parameters: Tensor, path: Path, drives: Drives) -> None:
    """Write an arm with these inertial parameters, friction and rotors as MJCF, for MuJoCo and Pinocchio.

    Links are drawn as the capsules that enclose them, which collide with nothing. What a description has
    fixed to a link is part of it.

    Args:
        arm: the arm: its chain, limits and gravity.
        parameters: m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joints' frames, (J, 10).
        path: where to write.
        drives: ``damping``, ``frictionloss`` and ``armature`` of the joints.

    Raises:
        RobotError: when a link would not be physically consistent, or MuJoCo does not load the file.
        StorageError: when the file cannot be written.
    """
    parameters = parameters.detach().double().cpu()
    require_consistent(arm, parameters)
    links = [f"{name} link" if name == _WORLD else name for name in arm.link_names]
    root = chain(arm, parameters, drives, _STEP, (links, arm.joint_names))
    for joint, limits in zip(root.iter("joint"), _limits(arm)):
        joint.attrib |= limits
    _draw(arm, [*root.iter("body")])
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    _check(arm, text)
    write_bytes(path, (text + "\n").encode("utf-8"))


def chain(
    arm: Arm,
    parameters: Tensor,
    drives: Drives,
    step: float,
    names: tuple[Sequence[str], Sequence[str]],
) -> ET.Element:
    """The `<mujoco>` element of an arm without shapes and limits; ``names`` are of the links and the joints.

    The links' parameters, (J, 10), are physically consistent; ``step`` is of the integration [s].
    """
    root = ET.Element("mujoco", model=arm.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    option = ET.SubElement(
        root, "option", timestep=repr(step), integrator="implicitfast", gravity=words(arm.gravity)
    )
    ET.SubElement(option, "flag", contact="disable", autoreset="disable")
    body = ET.SubElement(root, "worldbody")
    stiff = words([_STIFFEST * step, 1.0])
    for i, (inertial, link, joint) in enumerate(zip(_inertials(parameters), *names)):
        placement = {"pos": words(arm.translation[i]), "quat": _quaternion(arm.rotation[i])}
        body = ET.SubElement(body, "body", {"name": link} | placement)
        ET.SubElement(body, "inertial", inertial)
        kind = {"type": "slide" if arm.prismatic[i] else "hinge", "axis": words(arm.axis[i])}
        friction = {
            "damping": words([drives.viscous[i]]),
            "frictionloss": words([drives.coulomb[i]]),
            "armature": words([drives.rotor_inertia[i]]),
            "solreffriction": stiff,
        }
        ET.SubElement(body, "joint", {"name": joint} | kind | friction)
    return root


def _inertials(parameters: Tensor) -> Iterable[dict[str, str]]:
    """Attributes of each link's `<inertial>`, about the centre of mass and along the principal axes."""
    for row in parameters:
        centre, inertia = (x[0] for x in about_the_centre(row[None]))
        moments, axes = torch.linalg.eigh(inertia)
        moments[2] = moments[2].clamp_max(moments[:2].sum())  # but for rounding, which MuJoCo refuses
        axes = axes * torch.linalg.det(axes).sign()  # right-handed: minus one is no rotation
        yield {
            "mass": words(row[:1]),
            "pos": words(centre),
            "quat": _quaternion(axes),
            "diaginertia": words(moments),
        }


def _limits(arm: Arm) -> Iterable[dict[str, str]]:
    """Attributes of each joint's range and torque."""
    for lower, upper, effort in zip(arm.position_lower, arm.position_upper, arm.torque_limit):
        limits = {"range": words([lower, upper])}
        yield limits | ({"actuatorfrcrange": words([-effort, effort])} if effort.isfinite() else {})


def _draw(arm: Arm, bodies: Sequence[ET.Element]) -> None:
    """Give the bodies of the links, (J), the shapes of these."""
    each = zip(arm.capsules.link.tolist(), arm.capsules.a, arm.capsules.b, arm.capsules.radius)
    ghost = {"contype": "0", "conaffinity": "0", "group": "1"}
    for link, a, b, radius in each:
        if link < 0:
            continue
        is_ball = torch.equal(a, b)
        shape = {"type": "sphere" if is_ball else "capsule", "size": words([radius])}
        place = {"pos": words(a)} if is_ball else {"fromto": words([*a, *b])}
        ET.SubElement(bodies[link], "geom", shape | place | ghost)


def _check(arm: Arm, text: str) -> None:
    """Raise unless MuJoCo loads the model."""
    import mujoco

    try:
        with mujoco_logged(arm.name, logging.WARNING):
            mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise RobotError(f"MuJoCo refuses {arm.name}: {error}") from error


def _quaternion(rotation: Tensor) -> str:
    turn = scipy.spatial.transform.Rotation.from_matrix(rotation.numpy())
    return words(turn.as_quat()[[3, 0, 1, 2]])  # scalar first
