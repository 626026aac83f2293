"""An arm as MuJoCo's model, written as MJCF with explicit inertias."""

import xml.etree.ElementTree as ET
from collections.abc import Iterable
from typing import TYPE_CHECKING

import torch
from scipy.spatial.transform import Rotation
from torch import Tensor

from sidegan.errors import RobotError
from sidegan.plant.settings import IDEAL, PlantSettings
from sidegan.robot import Arm, require_consistent
from sidegan.robot.consistency import about_the_centre

if TYPE_CHECKING:
    import mujoco

_STIFFEST = 2.0  # steps: the shortest time constant with which MuJoCo solves friction


def mujoco_model(
    arm: Arm,
    settings: PlantSettings = IDEAL,
    stiffness: Tensor | None = None,
    damping: Tensor | None = None,
) -> "mujoco.MjModel":
    """MuJoCo's model of an arm, without contacts.

    Args:
        arm: the arm.
        settings: friction, rotor inertia and rate; a rigid body at 1 kHz when it is ideal.
        stiffness: of position servos [N·m/rad], (J,); no servos when None.
        damping: of the servos [N·m·s/rad], (J,).

    Raises:
        RobotError: when a link is not physically consistent, or MuJoCo refuses the arm.
        ConfigError: when the settings do not fit the arm.
    """
    import mujoco

    require_consistent(arm)
    try:
        return mujoco.MjModel.from_xml_string(_mjcf(arm, settings, stiffness, damping))
    except ValueError as error:
        raise RobotError(f"MuJoCo refuses {arm.name}: {error}") from error


def _mjcf(arm: Arm, settings: PlantSettings, stiffness: Tensor | None, damping: Tensor | None) -> str:
    """The model as MJCF; arguments as of ``mujoco_model``."""
    rate = settings.rate
    root = ET.Element("mujoco", model=arm.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    option = ET.SubElement(
        root, "option", timestep=repr(1 / rate), integrator="implicitfast", gravity=_words(arm.gravity)
    )
    ET.SubElement(option, "flag", contact="disable", autoreset="disable")
    body = ET.SubElement(root, "worldbody")
    friction = _friction(settings, arm.joints)
    for i, inertial in enumerate(_inertials(arm)):
        placement = {"pos": _words(arm.translation[i]), "quat": _quaternion(arm.rotation[i])}
        body = ET.SubElement(body, "body", {"name": f"link {i + 1}"} | placement)
        ET.SubElement(body, "inertial", inertial)
        kind = {"type": "slide" if arm.prismatic[i] else "hinge", "axis": _words(arm.axis[i])}
        ET.SubElement(body, "joint", {"name": f"{i + 1}"} | kind | friction[i])
    if stiffness is not None and damping is not None:
        actuators = ET.SubElement(root, "actuator")
        for i, (kp, kv, limit) in enumerate(zip(stiffness, damping, arm.torque_limit)):
            servo = {"joint": f"{i + 1}", "kp": _words([kp]), "kv": _words([kv])}
            if limit.isfinite():
                servo["forcerange"] = _words([-limit, limit])
            ET.SubElement(actuators, "position", servo)
    return ET.tostring(root, encoding="unicode")


def _inertials(arm: Arm) -> Iterable[dict[str, str]]:
    """Attributes of each link's `<inertial>`, about the centre of mass and along the principal axes."""
    for row in arm.inertial_parameters:
        centre, inertia = (x[0] for x in about_the_centre(row[None]))
        moments, axes = torch.linalg.eigh(inertia)
        axes = axes * torch.linalg.det(axes).sign()  # right-handed: minus one is no rotation
        yield {
            "mass": _words(row[:1]),
            "pos": _words(centre),
            "quat": _quaternion(axes),
            "diaginertia": _words(moments),
        }


def _friction(settings: PlantSettings, joints: int) -> list[dict[str, str]]:
    """Attributes of each joint that a rigid body has not."""
    viscous, coulomb, rotor = (settings.of(x, joints) for x in ("viscous", "coulomb", "rotor_inertia"))
    stiff = _words([_STIFFEST / settings.rate, 1.0])
    return [
        {
            "damping": _words([viscous[i]]),
            "frictionloss": _words([coulomb[i]]),
            "armature": _words([rotor[i]]),
            "solreffriction": stiff,
        }
        for i in range(joints)
    ]


def _quaternion(rotation: Tensor) -> str:
    return _words(Rotation.from_matrix(rotation.numpy()).as_quat()[[3, 0, 1, 2]])  # scalar first


def _words(values: Iterable[float | Tensor] | Tensor) -> str:
    return " ".join(repr(float(x)) for x in values)
