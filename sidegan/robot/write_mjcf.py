"""Writing of an arm as MJCF, with explicit inertias, friction and rotor inertia, and its torques.

Numbers are written in full. MuJoCo's own writer (``MjSpec.to_xml``) rounds them to six digits, with which
torques of an LWR are off by 2e-5 N·m.
"""

import logging
import xml.etree.ElementTree as ET
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array, numbers
from sidegan.base.storage import path_of, write_bytes
from sidegan.errors import RobotError
from sidegan.robot.arm import Arm, states_of
from sidegan.robot.consistency import about_the_centre, require_consistent
from sidegan.robot.drives import Drives
from sidegan.robot.fitting import corners, hull_of, inflated
from sidegan.robot.xml import child, words

_log = logging.getLogger(__name__)
_STEP = 1e-3  # [s] time step of a written model
_STIFFEST = 2.0  # steps; shortest time constant with which MuJoCo can solve friction


def write_mjcf(arm: Arm, parameters: ArrayLike, path: str | Path, drives: Drives) -> None:
    """Write an arm with these inertial parameters, friction and rotors as MJCF, for MuJoCo and Pinocchio.

    Shapes are the links' convex pieces, with exclusions of neighbours and of pairs that may touch; contacts
    are disabled as a whole. Links that the description fixes to another become bodies in it.

    Args:
        arm: the arm: its chain, limits and gravity.
        parameters: m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joints' frames, (J, 10).
        path: where to write.
        drives: ``damping``, ``frictionloss`` and ``armature`` of the joints; negative ones become 0.

    Raises:
        RobotError: when a link would not be physically consistent, or MuJoCo does not load the file.
        ShapeError: when the parameters are not (J, 10), or friction is not of J joints.
        StorageError: when the file cannot be written.
    """
    import mujoco

    path, parameters = path_of(path, "path"), numbers(parameters, "parameters")
    require_consistent(arm, parameters)
    drives.require_joints(arm.joints)
    possible = Drives(*(np.maximum(x, 0.0) for x in vars(drives).values()))  # no reader takes less
    root = chain(arm, parameters, possible, _STEP, (arm.link_names, arm.joint_names))
    limits = zip(arm.position_lower, arm.position_upper, arm.torque_limit)
    for joint, (lower, upper, effort) in zip(root.iter("joint"), limits):
        joint.set("range", words([lower, upper]))
        if np.isfinite(effort):
            joint.set("actuatorfrcrange", words([-effort, effort]))
    _add_shapes(arm, root)
    ET.indent(root)
    text = ET.tostring(root, encoding="unicode")
    try:
        with mujoco_logged(arm.name, logging.WARNING):
            mujoco.MjModel.from_xml_string(text)
    except ValueError as error:
        raise RobotError(f"MuJoCo refuses {arm.name}: {error}") from error
    write_bytes(path, (text + "\n").encode("utf-8"))


def torque_of_mjcf(path: str | Path, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
    """MuJoCo's torque [N·m or N], (S, J), of an MJCF at states (S, J), even beyond its joints' ranges.

    Raises:
        RobotError: when MuJoCo does not load the file.
        ShapeError: when the states are not (S, J), all three alike.
    """
    import mujoco

    with mujoco_logged(Path(path).name):
        try:
            model = mujoco.MjModel.from_xml_path(str(path))
        except ValueError as error:
            raise RobotError(f"MuJoCo refuses {path}: {error}") from error
        states = states_of(model.nv, q, dq, ddq)
        model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_LIMIT
        data = mujoco.MjData(model)
        torque = np.empty_like(states[0])
        for k, (data.qpos[:], data.qvel[:], data.qacc[:]) in enumerate(zip(*states)):
            mujoco.mj_inverse(model, data)
            torque[k] = data.qfrc_inverse
    return torque


def chain(
    arm: Arm,
    parameters: Array,
    drives: Drives,
    step: float,
    names: tuple[Sequence[str], Sequence[str]],
) -> ET.Element:
    """The `<mujoco>` element of an arm without shapes and limits.

    ``parameters``, (J, 10), must be physically consistent; ``step`` is the time step [s]; ``names`` are those
    of the links and of the joints.
    """
    root = ET.Element("mujoco", model=arm.name)
    ET.SubElement(root, "compiler", angle="radian", autolimits="true")
    option = ET.SubElement(
        root, "option", timestep=repr(step), integrator="implicitfast", gravity=words(arm.gravity)
    )
    ET.SubElement(option, "flag", contact="disable", autoreset="disable")
    body = ET.SubElement(root, "worldbody")
    stiff = words([_STIFFEST * step, 1.0])
    for i, (row, link, joint) in enumerate(zip(parameters, *names)):
        placement = {"pos": words(arm.translation[i]), "quat": _quaternion(arm.rotation[i])}
        body = ET.SubElement(body, "body", {"name": link} | placement)
        centre, inertia = about_the_centre(row)
        moments, axes = np.linalg.eigh(inertia)
        moments[2] = min(moments[2], moments[:2].sum())  # MuJoCo refuses violations by rounding
        axes = axes * np.sign(np.linalg.det(axes))  # make them right-handed
        mass = {"mass": words(row[:1]), "pos": words(centre), "quat": _quaternion(axes)}
        ET.SubElement(body, "inertial", mass | {"diaginertia": words(moments)})
        kind = {"type": "slide" if arm.prismatic[i] else "hinge", "axis": words(arm.axis[i])}
        friction = {
            "damping": words([drives.viscous[i]]),
            "frictionloss": words([drives.coulomb[i]]),
            "armature": words([drives.rotor_inertia[i]]),
            "solreffriction": stiff,
        }
        ET.SubElement(body, "joint", {"name": joint} | kind | friction)
    return root


def _add_shapes(arm: Arm, root: ET.Element) -> None:
    """Add shapes to the bodies of links and of what is fixed to them."""
    world = child(root, "worldbody", "")
    assets = ET.Element("asset")
    moving = [*root.iter("body")]
    bodies = {"world": world} | {body.get("name", ""): body for body in moving}
    for k, (link, owner) in enumerate(zip(arm.capsules.link.tolist(), arm.capsules.owners)):
        if owner not in bodies:
            bodies[owner] = ET.SubElement(world if link < 0 else moving[link], "body", name=owner)
        ET.SubElement(bodies[owner], "geom", {"group": "1", "mass": "0"} | _shape(arm, k, assets))
    before = dict(arm.parents or ()).get(arm.link_names[0])
    if before in bodies:  # nested bodies count as neighbours
        world.remove(moving[0])
        bodies[before].append(moving[0])
    if len(assets):
        root.insert(1, assets)
    contact = ET.Element("contact")
    links = dict(zip(arm.capsules.owners, arm.capsules.link.tolist()))
    # Shapes around an offset anchor are in a body of their own, so that MuJoCo does not see their neighbours.
    beside = [pair for pair in arm.parents or () if abs(links.get(pair[0], -1) - links.get(pair[1], -1)) == 1]
    pairs = {tuple(sorted(pair)) for pair in (*beside, *(pair for *pair, _ in arm.may_touch))}
    for a, b in sorted(pairs):
        if {a, b} <= {*bodies}:
            ET.SubElement(contact, "exclude", body1=a, body2=b)
    if len(contact):
        root.append(contact)


def _shape(arm: Arm, k: int, assets: ET.Element) -> dict[str, str]:
    """Attributes of the geom of a capsule, or of the hull inside, which is added to the assets."""
    capsules = arm.capsules
    a, b, radius = capsules.a[k], capsules.b[k], capsules.radius[k]
    if not capsules.exact[k]:
        points = inflated(capsules.hulls[k], float(capsules.rounding[k]))
        if hull_of(points) is not None:
            ET.SubElement(assets, "mesh", name=f"piece {k}", vertex=words(corners(points).ravel()))
            return {"type": "mesh", "mesh": f"piece {k}"}
    if np.array_equal(a, b):
        return {"type": "sphere", "size": words([radius]), "pos": words(a)}
    return {"type": "capsule", "size": words([radius]), "fromto": words([*a, *b])}


def _quaternion(rotation: Array) -> str:
    return words(pin.Quaternion(rotation).coeffs()[[3, 0, 1, 2]])  # scalar first


@contextmanager
def mujoco_logged(what: object, level: int = logging.DEBUG) -> Iterator[None]:
    """Log MuJoCo's warnings within the block, not in MUJOCO_LOG.TXT, prefixed by what they are about.

    Diverging simulations are detected from the motion itself, so their warnings are only for debugging.
    """
    import mujoco

    before = mujoco.get_mju_user_warning()
    mujoco.set_mju_user_warning(lambda text: _log.log(level, "%s: %s", what, text))
    try:
        yield
    finally:
        mujoco.set_mju_user_warning(before)
