"""MuJoCo model of an arm, with servos."""

import math
import xml.etree.ElementTree as ET
from typing import TYPE_CHECKING

from sidegan.base.arrays import Array
from sidegan.errors import RobotError
from sidegan.plant.settings import IDEAL, PlantSettings
from sidegan.robot import Arm, require_consistent
from sidegan.robot.drives import Drives
from sidegan.robot.write_mjcf import chain, mujoco_logged
from sidegan.robot.xml import words

if TYPE_CHECKING:
    import mujoco


def mujoco_model(
    arm: Arm, settings: PlantSettings = IDEAL, stiffness: Array | None = None, damping: Array | None = None
) -> "mujoco.MjModel":
    """MuJoCo model of an arm, without contacts.

    Args:
        arm: the arm.
        settings: friction, rotor inertia and rate; by default a rigid body at 1 kHz.
        stiffness: of position servos [N·m/rad], (J,); None: no servos.
        damping: of the servos [N·m·s/rad], (J,).

    Raises:
        RobotError: when a link is not physically consistent, or MuJoCo refuses the arm.
        ConfigError: when the settings do not fit the arm.
    """
    import mujoco

    require_consistent(arm)
    drives = Drives(*(settings.of(x, arm.joints) for x in ("viscous", "coulomb", "rotor_inertia")))
    names = [f"link {i + 1}" for i in range(arm.joints)], [f"{i + 1}" for i in range(arm.joints)]
    root = chain(arm, arm.inertial_parameters, drives, 1 / settings.rate, names)
    if stiffness is not None and damping is not None:
        actuators = ET.SubElement(root, "actuator")
        for joint, kp, kv, limit in zip(names[1], stiffness, damping, arm.torque_limit):
            servo = {"joint": joint, "kp": words([kp]), "kv": words([kv])}
            if math.isfinite(limit):
                servo["forcerange"] = words([-limit, limit])
            ET.SubElement(actuators, "position", servo)
    try:
        with mujoco_logged(arm.name):
            return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise RobotError(f"MuJoCo refuses {arm.name}: {error}") from error
