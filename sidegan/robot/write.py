"""Writing of a URDF with other inertias and friction, and its torques."""

import xml.etree.ElementTree as ET
from dataclasses import replace
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array, numbers
from sidegan.base.storage import path_of, replacing
from sidegan.errors import RobotError
from sidegan.robot import xml
from sidegan.robot.arm import Arm, states_of
from sidegan.robot.consistency import about_the_centre, require_consistent
from sidegan.robot.description import read_description
from sidegan.robot.drives import Drives
from sidegan.robot.model import kinematics_and_inertias, pinocchio_model
from sidegan.robot.placement import from_rpy
from sidegan.robot.sources import parsed, read_source
from sidegan.robot.tree import read_tree
from sidegan.robot.xml import words

_TOLERANCE = 1e-12  # of the largest parameter, for errors of writing and reading


def write_urdf(arm: Arm, parameters: ArrayLike, path: str | Path, drives: Drives | None = None) -> None:
    """Write the arm's URDF with these inertial parameters and otherwise unchanged.

    Where the source lacks limits that URDF requires, or has impossible ones, the arm's are written. Capsules
    of an MJCF, which URDF does not have, become cylinders with a ball at each end.

    Each joint's parameters go to the link that it moves; links fixed to that one lose their inertia, which
    is included. The file is written atomically, after a check that it reads back to the same parameters.

    Args:
        arm: the arm, whose description is the start, of any format.
        parameters: m, mx, my, mz, Ixx, Ixy, Iyy, Ixz, Iyz, Izz about the joints' frames, (J, 10).
        path: where to write; in the source's folder, if mesh paths are relative.
        drives: friction for the joints' `<dynamics>`, unchanged if None; URDF has no rotor inertia.

    Raises:
        RobotError: when a link would not be physically consistent, or the source is no longer the arm's.
        ShapeError: when the parameters are not (J, 10), or friction is not of J joints.
        StorageError: when the file cannot be written.
    """
    path, parameters = path_of(path, "path"), numbers(parameters, "parameters")
    require_consistent(arm, parameters)
    if drives is not None:
        drives.require_joints(arm.joints)
    if not arm.urdf.is_file():
        raise RobotError(f"{arm.name} has no description to start from: there is no file {arm.urdf}")
    source = read_source(arm.urdf, arm.setup.args)
    carriers = _carriers(arm, source.root)
    inertials = dict(zip(arm.link_names, map(_inertial, parameters)))
    root = parsed(source.text, comments=True)
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    for k, name in enumerate(arm.joint_names):
        _complete_limits(joints[name], arm, k)
    if source.gravity is not None:  # an MJCF
        _replace_capsules(root)
    for link in root.findall("link"):
        name = link.get("name", "")
        if carriers[name] is not None:
            _put(link, "inertial", inertials.get(name))
    if drives is not None:
        for k, name in enumerate(arm.joint_names):  # no reader takes less than 0
            damping = repr(max(float(drives.viscous[k]), 0.0))
            coulomb = repr(max(float(drives.coulomb[k]), 0.0))
            _put(joints[name], "dynamics", ET.Element("dynamics", damping=damping, friction=coulomb))
    with replacing(path) as draft:
        ET.ElementTree(root).write(draft, encoding="utf-8", xml_declaration=True)
        _check(arm, parameters, draft)


def torque_of_urdf(path: str | Path, arm: Arm, q: ArrayLike, dq: ArrayLike, ddq: ArrayLike) -> Array:
    """Pinocchio's torque [N·m or N], (S, J), of an arm's URDF at states (S, J), with damping and friction.

    Friction changes its sign with the velocity at once, as the format means it.

    Raises:
        ShapeError: when the states are not (S, J), all three alike.
    """
    states = states_of(arm.joints, q, dq, ddq)
    setup = replace(arm.setup, args=None, mount=arm.mount, friction=True)
    model = pinocchio_model(description := read_description(Path(path), setup, planning=False))
    model.gravity.linear = arm.gravity  # which no URDF states
    data = model.createData()
    rigid = np.array([pin.rnea(model, data, *state).copy() for state in zip(*states)]).reshape(-1, arm.joints)
    return rigid + (description.drives or Drives.none(arm.joints)).torque(*states[1:])


def _carriers(arm: Arm, root: ET.Element) -> dict[str, str | None]:
    """The moving link that each link is part of; None for the base. Raises if joints are not the arm's."""
    tree = read_tree(root, str(arm.urdf))
    moved = {joint.child: name for name, joint in tree.joints.items() if name in arm.joint_names}
    if moved != dict(zip(arm.link_names, arm.joint_names)):
        raise RobotError(f"{arm.urdf} is no longer the description of {arm.name}: its joints differ")
    paths = {link: [joint.child for joint in tree.path(link) if joint.child in moved] for link in tree.links}
    return {link: path[-1] if path else None for link, path in paths.items()}


def _put(owner: ET.Element, tag: str, element: ET.Element | None) -> None:
    """Replace the child with this tag by an element, or by nothing; insert it first if there is none."""
    before = owner.find(tag)
    index, tail = (0, "\n    ") if before is None else ([*owner].index(before), before.tail)
    if before is not None:
        owner.remove(before)
    if element is not None:
        ET.indent(element, level=2)
        element.tail = tail
        owner.insert(index, element)


def _complete_limits(joint: ET.Element, arm: Arm, k: int) -> None:
    """Write the arm's limits where its k-th joint has none or impossible ones."""
    limit = joint.find("limit")
    if limit is None:
        limit = ET.SubElement(joint, "limit")
    lower, upper = (xml.number_or_zero(limit.get(end)) for end in ("lower", "upper"))
    if joint.get("type") != "continuous" and not lower < upper:
        limit.set("lower", repr(float(arm.position_lower[k])))
        limit.set("upper", repr(float(arm.position_upper[k])))
    if not xml.number_or_zero(limit.get("velocity")) > 0:
        limit.set("velocity", repr(float(arm.velocity_limit[k])))
    unread = limit.attrib.pop("not_read", None)  # of an MJCF's motor
    if (unread or "effort" not in limit.attrib) and np.isfinite(arm.torque_limit[k]):
        limit.set("effort", repr(float(arm.torque_limit[k])))
    limit.attrib.setdefault("effort", "0")


def _replace_capsules(root: ET.Element) -> None:
    """Replace capsules, which URDF does not have, by cylinders with a ball at each end."""
    for link in root.findall("link"):
        for shape in [child for child in link if child.find("geometry/capsule") is not None]:
            capsule = xml.child(xml.child(shape, "geometry", ""), "capsule", "")
            radius = capsule.get("radius", "")
            place, rpy = xml.origin(shape, "")
            axis = from_rpy(rpy)[:, 2]
            for side in (-0.5, 0.5):
                ball = ET.SubElement(link, shape.tag)
                centre = np.array(place) + side * xml.scalar(capsule, "length", "") * axis
                ET.SubElement(ball, "origin", xyz=words(centre), rpy="0 0 0")
                ET.SubElement(ET.SubElement(ball, "geometry"), "sphere", radius=radius)
            capsule.tag = "cylinder"


def _inertial(parameters: Array) -> ET.Element:
    """An `<inertial>` element, about the centre of mass, from parameters (10,)."""
    centre, inertia = about_the_centre(parameters)
    (xx, xy, xz), (_, yy, yz), (_, _, zz) = inertia.tolist()
    moments = {"ixx": xx, "ixy": xy, "ixz": xz, "iyy": yy, "iyz": yz, "izz": zz}
    element = ET.Element("inertial")
    ET.SubElement(element, "mass", value=repr(float(parameters[0])))
    ET.SubElement(element, "origin", xyz=words(centre), rpy="0 0 0")
    ET.SubElement(element, "inertia", {name: repr(x) for name, x in moments.items()})
    return element


def _check(arm: Arm, parameters: Array, file: Path) -> None:
    """Raise unless the file reads as the same arm with these parameters."""
    setup = replace(arm.setup, args=None, mount=arm.mount)
    model = pinocchio_model(read_description(file, setup, planning=False))
    chain = kinematics_and_inertias(model, setup.tip)
    del chain["gravity"]  # no URDF states it
    for name, value in chain.items():
        own = parameters if name == "inertial_parameters" else getattr(arm, name)
        atol = _TOLERANCE * max(float(np.abs(own).max()), 1.0)
        if value.shape != own.shape or not np.allclose(value, own, rtol=0, atol=atol):
            what = name.replace("_", " ")
            raise RobotError(f"{arm.urdf} with new inertias does not read as {arm.name}: different {what}")
