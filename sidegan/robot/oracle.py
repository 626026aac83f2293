"""An arm as Pinocchio has it: to check our own dynamics and distances against, and for single states."""

from collections.abc import Iterable
from itertools import combinations
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

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


class StateRegressor:
    """The full regressor, (J, 10 J), of one state at a time in some ten microseconds, by Pinocchio.

    Args:
        arm: whose parameters the columns are of, link by link in Pinocchio's order.
    """

    def __init__(self, arm: Arm) -> None:
        import pinocchio as pin

        self._model = chain_model(arm)
        self._data = self._model.createData()
        self._regressor = pin.computeJointTorqueRegressor

    def __call__(self, *state: NDArray[np.float64]) -> NDArray[np.float64]:
        """Regressor of a state: position, velocity and acceleration, (J,) each."""
        return self._regressor(self._model, self._data, *state)


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


def collides(arm: Arm, q: NDArray[np.float64], exempt: Iterable[tuple[str, str]]) -> NDArray[np.bool_]:
    """Whether links of an arm collide, (N,), at positions (N, J), by coal on the description's own shapes.

    Args:
        arm: whose description and meshes are still there.
        q: positions [rad or m].
        exempt: pairs of links that may touch; those that no joint moves against each other may, too.

    Raises:
        RobotError: when the file is gone, or is no longer a description of an arm.
    """
    import pinocchio as pin

    from sidegan.robot.model import build

    description = read_description(arm.urdf, arm.setup)
    model = build(description)
    geometry = pin.buildGeomFromUrdfString(model, description.xml, pin.GeometryType.COLLISION)
    shapes = list(geometry.geometryObjects)
    owners = [model.frames[shape.parentFrame].name for shape in shapes]
    spared = {frozenset(pair) for pair in exempt}
    for i, k in combinations(range(len(shapes)), 2):
        if shapes[i].parentJoint != shapes[k].parentJoint and {owners[i], owners[k]} not in spared:
            geometry.addCollisionPair(pin.CollisionPair(i, k))
    data, found = model.createData(), geometry.createData()
    for request in found.collisionRequests:
        request.enable_contact = True  # without it coal 3.0 misses some collisions of two cylinders
    return np.array([pin.computeCollisions(model, data, geometry, found, x, True) for x in q], dtype=bool)
