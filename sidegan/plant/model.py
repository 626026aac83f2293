"""MuJoCo model of an arm: friction, drives and servos."""

import math
import xml.etree.ElementTree as ET
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted
from sidegan.base.typed import Hertz, NonNegative, Positive, Share
from sidegan.errors import ConfigError, RobotError
from sidegan.robot import Arm, require_consistent
from sidegan.robot.drives import Drives
from sidegan.robot.write_mjcf import chain, mujoco_logged
from sidegan.robot.xml import words

if TYPE_CHECKING:
    import mujoco


@dataclass(frozen=True, kw_only=True)
class PlantSettings:
    """Friction, drives and servos; a list holds a value per joint, or a single one for all joints.

    The units are those of revolute joints; for prismatic ones read N for N·m, m for rad and kg for kg·m².
    """

    rate: Hertz = 1000.0  # [Hz] of the servos, and of the recording
    viscous: list[NonNegative] = field(default_factory=lambda: [2.0])  # friction [N·m·s/rad]
    coulomb: list[NonNegative] = field(default_factory=lambda: [1.0])  # friction [N·m]
    # reflected to the joint [kg·m²]
    rotor_inertia: list[NonNegative] = field(default_factory=lambda: [0.1])
    bandwidth: list[Hertz] = field(default_factory=lambda: [10.0])  # of the position servo [Hz]
    damping_ratio: list[Positive] = field(default_factory=lambda: [1.0])  # of the position servo
    feed_forward: Share = 1.0  # share of the inverse dynamics that the controller adds, without friction
    tolerance: Positive = 0.1  # [rad] tracking error at which the execution has failed

    def of(self, name: str, joints: int) -> Array:
        """A setting as a value per joint, (J,).

        Raises:
            ConfigError: when it has neither one value nor J.
        """
        values = getattr(self, name)
        if len(values) not in (1, joints):
            has = counted(len(values), "value")
            raise ConfigError(f"plant.{name} has {has}, expected one, or one for each of {joints} joints")
        return np.full(joints, values, float)


# Without friction, and with an exact feed-forward.
IDEAL = PlantSettings(viscous=[0.0], coulomb=[0.0], rotor_inertia=[0.0])


def mujoco_model(
    arm: Arm, settings: PlantSettings = IDEAL, stiffness: Array | None = None, damping: Array | None = None
) -> "mujoco.MjModel":
    """MuJoCo model of an arm, without contacts; by default a rigid body at 1 kHz.

    It has position servos if there are stiffness [N·m/rad] and damping [N·m·s/rad], (J,) each.

    Raises:
        RobotError: when a link is not physically consistent, or MuJoCo refuses the arm.
        ConfigError: when the settings do not fit the arm.
    """
    import mujoco

    require_consistent(arm)
    drives = Drives(
        viscous=settings.of("viscous", arm.joints),
        coulomb=settings.of("coulomb", arm.joints),
        rotor_inertia=settings.of("rotor_inertia", arm.joints),
    )
    links = [f"link {i + 1}" for i in range(arm.joints)]
    joints = [f"{i + 1}" for i in range(arm.joints)]
    root = chain(arm, arm.inertial_parameters, drives, 1 / settings.rate, (links, joints))
    if stiffness is not None and damping is not None:
        actuators = ET.SubElement(root, "actuator")
        for joint, kp, kv, limit in zip(joints, stiffness, damping, arm.torque_limit):
            servo = {"joint": joint, "kp": words([kp]), "kv": words([kv])}
            if math.isfinite(limit):
                servo["forcerange"] = words([-limit, limit])
            ET.SubElement(actuators, "position", servo)
    try:
        with mujoco_logged(arm.name):
            return mujoco.MjModel.from_xml_string(ET.tostring(root, encoding="unicode"))
    except ValueError as error:
        raise RobotError(f"MuJoCo refuses {arm.name}: {error}") from error
