"""An arm as Pinocchio has it, to check our own dynamics and distances against."""

from typing import TYPE_CHECKING

import numpy as np

from sidegan.robot.arm import Arm
from sidegan.robot.description import read_description

if TYPE_CHECKING:
    import pinocchio as pin


def pinocchio_model(arm: Arm) -> "pin.Model":
    """Pinocchio's own model of an arm, read anew from the arm's file.

    Raises:
        RobotError: when the file is gone, or is no longer a description of an arm.
    """
    from sidegan.robot.model import build

    return build(read_description(arm.urdf, arm.setup))


def chain_model(arm: Arm) -> "pin.Model":
    """Pinocchio's model with an arm's own numbers, whether or not its file is still there."""
    import pinocchio as pin

    model = pin.Model()
    model.gravity.linear = arm.gravity.numpy()
    for i, name in enumerate(arm.joint_names):
        kind = pin.JointModelPrismaticUnaligned if arm.prismatic[i] else pin.JointModelRevoluteUnaligned
        placement = pin.SE3(arm.rotation[i].numpy(), arm.translation[i].numpy())
        model.addJoint(i, kind(arm.axis[i].numpy()), placement, name)
        inertia = pin.Inertia.FromDynamicParameters(arm.inertial_parameters[i].numpy())
        model.appendBodyToJoint(i + 1, inertia, pin.SE3.Identity())
    return model


def capsule_geometry(arm: Arm) -> "pin.GeometryModel":
    """An arm's C capsules as Pinocchio's collision geometry, in order and without collision pairs."""
    import coal
    import pinocchio as pin

    geometry = pin.GeometryModel()
    shapes = arm.capsules
    for i, name in enumerate(shapes.names):
        a, b = shapes.a[i].numpy(), shapes.b[i].numpy()
        length = float(np.linalg.norm(b - a))
        direction = (b - a) / length if length else np.array([0.0, 0.0, 1.0])
        turn = pin.Quaternion.FromTwoVectors(np.array([0.0, 0.0, 1.0]), direction)
        placement = pin.SE3(turn.matrix(), (a + b) / 2)
        capsule = coal.Capsule(float(shapes.radius[i]), length)
        geometry.addGeometryObject(pin.GeometryObject(name, int(shapes.link[i]) + 1, placement, capsule))
    return geometry
