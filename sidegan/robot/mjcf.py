"""Conversion of MJCF to URDF: MuJoCo compiles it, and bodies, joints and shapes are written out."""

import xml.etree.ElementTree as ET
from pathlib import Path
from typing import Any

import mujoco
import pinocchio as pin

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.robot.arm import FilePlane
from sidegan.robot.meshes import kept_mesh
from sidegan.robot.mjcf_files import compile_mjcf
from sidegan.robot.mjcf_forces import Forces, efforts
from sidegan.robot.placement import write_placement
from sidegan.robot.tree import MOVABLE
from sidegan.robot.write_mjcf import mujoco_logged
from sidegan.robot.xml import Source, words

_KINDS = {
    mujoco.mjtJoint.mjJNT_FREE: "floating",
    mujoco.mjtJoint.mjJNT_BALL: "ball",
    mujoco.mjtJoint.mjJNT_SLIDE: "prismatic",
    mujoco.mjtJoint.mjJNT_HINGE: "revolute",
}
_SHAPES = {
    mujoco.mjtGeom.mjGEOM_SPHERE: "sphere",
    mujoco.mjtGeom.mjGEOM_CAPSULE: "capsule",
    mujoco.mjtGeom.mjGEOM_CYLINDER: "cylinder",
    mujoco.mjtGeom.mjGEOM_BOX: "box",
    mujoco.mjtGeom.mjGEOM_ELLIPSOID: "box",  # around it
    mujoco.mjtGeom.mjGEOM_MESH: "mesh",
}
_HIDDEN = 3  # first group of geoms that MuJoCo's viewers hide by default


def read_mjcf(path: Path) -> Source:
    """A description from an MJCF file, with links named like bodies.

    MJCF has no velocity limits; torque limits are the joints' or else the actuators'. Linear equality
    constraints of two joints become mimic joints, others loops. Height fields are dropped; fixed planes are
    listed separately.
    """
    spec, model, colliding, shown = compile_mjcf(path)
    with mujoco_logged(path):
        forces = Forces(spec, model)
    root = ET.Element("robot", name=spec.modelname)
    left_out = []
    for body in spec.bodies:
        link = ET.SubElement(root, "link", name=body.name)
        _write_inertia(link, model.body(body.id))
        shapes = [geom for geom in body.geoms if not _is_fixed_plane(model, geom)]
        left_out += [f"{geom.name} of {body.name}" for geom in shapes if not _write_shape(link, model, geom)]
        if body.id:  # the world has no parent
            _write_joints(root, model, body)
    _write_limits(root, spec, model, forces)
    _write_constraints(root, spec, model, forces)
    names = {body.id: body.name for body in spec.bodies}
    for pair in model.exclude_signature.tolist():  # two bodies in one number
        one, other = (names[body] for body in divmod(pair, 1 << 16))
        ET.SubElement(root, "disable_collisions", link1=one, link2=other, reason="contact exclude")
    return Source(
        text=ET.tostring(root, encoding="utf-8"),
        root=root,
        notes=tuple(_notes(spec, model, left_out, shown)),
        missing=colliding,
        planes=_planes(spec, model),
        gravity=tuple(map(float, model.opt.gravity)),
        postures=_postures(spec, model),
        passive=forces.passive,
    )


def _notes(
    spec: mujoco.MjSpec, model: mujoco.MjModel, left_out: list[str], shown: dict[str, list[str]]
) -> list[str]:
    """Notes on what could not be carried over."""
    notes = []
    if left_out:
        notes.append(f"unsupported shapes left out: {listed(left_out)}")
    if floats := [body.name for body in spec.bodies if body.gravcomp]:
        notes.append(f"gravity of {listed(floats)} is compensated (gravcomp): actuator torques exclude it")
    if shown:
        notes.append(f"not shown, since the mesh files are missing: {listed(list(shown))}")
    return notes


def _postures(spec: mujoco.MjSpec, model: mujoco.MjModel) -> dict[str, dict[str, float]]:
    """Positions of revolute and prismatic joints [rad or m] by keyframe and name."""
    movable = {joint.name: model.jnt_qposadr[joint.id] for joint in _movable(spec)}
    return {
        key.name: {joint: float(model.key_qpos[key.id, place]) for joint, place in movable.items()}
        for key in spec.keys
    }


def _movable(spec: mujoco.MjSpec) -> list[mujoco.MjsJoint]:
    """Revolute and prismatic joints."""
    return [joint for joint in spec.joints if _KINDS[joint.type] in MOVABLE]


def _planes(spec: mujoco.MjSpec, model: mujoco.MjModel) -> tuple[FilePlane, ...]:
    """Unit normals of fixed planes, and offsets along them [m]."""
    data = mujoco.MjData(model)
    mujoco.mj_kinematics(model, data)
    planes = []
    for geom in (data.geom(geom.id) for geom in spec.geoms if _is_fixed_plane(model, geom)):
        x, y, z = normal = geom.xmat.reshape(3, 3)[:, 2].tolist()
        planes.append((x, y, z, float(geom.xpos @ normal)))
    return tuple(planes)


def _is_fixed_plane(model: mujoco.MjModel, geom: mujoco.MjsGeom) -> bool:
    return geom.type == mujoco.mjtGeom.mjGEOM_PLANE and not model.body_weldid[geom.parent.id]


def _write_inertia(link: ET.Element, body: Any) -> None:
    """Write a compiled body's mass and inertia, unless it has none."""
    if not body.mass:
        return
    inertial = ET.SubElement(link, "inertial")
    write_placement(ET.SubElement(inertial, "origin"), _rotation(body.iquat), body.ipos)
    ET.SubElement(inertial, "mass", value=words(body.mass))
    xx, yy, zz = words(body.inertia).split()
    ET.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")


def _write_joints(root: ET.Element, model: mujoco.MjModel, body: mujoco.MjsBody) -> None:
    """Write the joints between a body and its parent; all but the last lead to auxiliary links.

    If the last one's anchor is not the body's origin, a fixed joint leads from it to the body.
    """
    parent = body.parent.name
    compiled = model.body(body.id)
    place = pin.SE3(_rotation(compiled.quat), compiled.pos)
    for count, spec in enumerate(body.joints, 1):
        kind = _KINDS[spec.type]
        joint = model.joint(spec.id)
        anchor = pin.SE3.Identity()
        before = pin.Motion.Zero()  # from the position that the joint has as described to 0
        if kind == "prismatic":
            before.linear = -joint.qpos0 * joint.axis
        elif kind == "revolute":
            before.angular = -joint.qpos0 * joint.axis
        if kind in MOVABLE:
            anchor.translation = joint.pos
        direct = count == len(body.joints) and anchor.isIdentity(0.0)
        child = body.name if direct else f"{body.name}/{spec.name}"
        if not direct:
            ET.SubElement(root, "link", name=child)
        _write_joint(root, spec.name, kind, parent, child, place * anchor * pin.exp6(before))
        if direct:
            return
        parent = child
        place = anchor.inverse()
    _write_joint(root, f"{body.name}/fixed", "fixed", parent, body.name, place)


def _write_joint(root: ET.Element, name: str, kind: str, parent: str, child: str, place: pin.SE3) -> None:
    joint = ET.SubElement(root, "joint", name=name, type=kind)
    ET.SubElement(joint, "parent", link=parent)
    ET.SubElement(joint, "child", link=child)
    write_placement(ET.SubElement(joint, "origin"), place.rotation, place.translation)


def _write_limits(root: ET.Element, spec: mujoco.MjSpec, model: mujoco.MjModel, forces: Forces) -> None:
    """Write the axes, dynamics and limits of revolute and prismatic joints."""
    elements = {element.get("name"): element for element in root.findall("joint")}
    available = efforts(spec, model)
    for name, joint in ((joint.name, model.joint(joint.id)) for joint in _movable(spec)):
        element = elements[name]
        ET.SubElement(element, "axis", xyz=words(joint.axis))
        stated = {"damping": joint.damping, "friction": joint.frictionloss, "armature": joint.armature}
        ET.SubElement(element, "dynamics", {what: words(x[:1]) for what, x in stated.items()})
        limit = ET.SubElement(element, "limit", effort=repr(available.get(name, 0.0)))
        for motor, joints in forces.motors.items():
            if name in joints:
                limit.set("not_read", motor)
        if joint.limited:
            lower, upper = joint.range.tolist()
            limit.set("lower", repr(lower))
            limit.set("upper", repr(upper))
        elif element.get("type") == "revolute":
            element.set("type", "continuous")


def _write_constraints(root: ET.Element, spec: mujoco.MjSpec, model: mujoco.MjModel, forces: Forces) -> None:
    """Write equality constraints: linear ones of two joints as mimic joints, others as loops."""
    joints = {element.get("name"): element for element in root.findall("joint")}
    for equality in (equality for equality in spec.equalities if equality.active):
        linear = not equality.data[2:5].any()  # of a polynomial between displacements from qpos0
        if equality.type == mujoco.mjtEq.mjEQ_JOINT and equality.name2 and linear:
            offset, factor = equality.data.tolist()[:2]
            follower, leader = (model.joint(name).qpos0.item() for name in (equality.name1, equality.name2))
            mimic = ET.SubElement(joints[equality.name1], "mimic", joint=equality.name2)
            mimic.set("multiplier", repr(factor))
            mimic.set("offset", repr(follower + offset - factor * leader))
            continue
        for bodies in _tied(spec, equality, forces):
            loop = ET.SubElement(root, "loop_joint", name=equality.name)
            for body in bodies:
                ET.SubElement(loop, "link", link=body)


def _tied(spec: mujoco.MjSpec, equality: mujoco.MjsEquality, forces: Forces) -> list[list[str]]:
    """Pairs of bodies that an equality constraint ties; no bodies if it is none of the arm's."""
    match equality.type:
        case mujoco.mjtEq.mjEQ_CONNECT | mujoco.mjtEq.mjEQ_WELD:
            ends = equality.name1, equality.name2 or "world"
            on_sites = equality.objtype == mujoco.mjtObj.mjOBJ_SITE
            bodies = [spec.site(end).parent if on_sites else spec.body(end) for end in ends]
            return [[] if any(body.mocap for body in bodies) else [body.name for body in bodies]]
        case mujoco.mjtEq.mjEQ_JOINT:
            held = {equality.name1}
        case mujoco.mjtEq.mjEQ_TENDON:
            held = {*forces.tendons[equality.name1], *forces.tendons.get(equality.name2, ())}
        case _:
            return [[]]
    bodies = [spec.joint(joint).parent for joint in sorted(held)]
    return [[body.name, body.parent.name] for body in bodies]


def _write_shape(link: ET.Element, model: mujoco.MjModel, geom: mujoco.MjsGeom) -> bool:
    """Write a geom as a collision or visual shape, or both; False if URDF has no such shape."""
    kind = _SHAPES.get(geom.type)
    if kind is None:
        return False
    collides = geom.contype or geom.conaffinity or geom.id in {*model.pair_geom1, *model.pair_geom2}
    if collides:
        _write_geometry(ET.SubElement(link, "collision"), kind, model, geom.id)
    if not collides or (kind == "mesh" and geom.group < _HIDDEN):
        _write_geometry(ET.SubElement(link, "visual"), kind, model, geom.id)
    return True


def _write_geometry(element: ET.Element, kind: str, model: mujoco.MjModel, geom: int) -> None:
    """Write the origin and geometry of a shape of a URDF's kind."""
    shape = model.geom(geom)
    x, y, z = shape.size.tolist()
    if kind == "mesh":  # as MuJoCo compiled it: scaled, and in its principal axes of inertia
        mesh = shape.dataid.item()
        vertex, face = model.mesh_vertadr[mesh], model.mesh_faceadr[mesh]
        vertices = model.mesh_vert[vertex : vertex + model.mesh_vertnum[mesh]]
        faces = model.mesh_face[face : face + model.mesh_facenum[mesh]]
        sizes = {"filename": str(kept_mesh(vertices, faces))}
    elif kind == "box":
        sizes = {"size": words([2 * x, 2 * y, 2 * z])}
    else:
        sizes = {"radius": repr(x)} | ({} if kind == "sphere" else {"length": repr(2 * y)})
    write_placement(ET.SubElement(element, "origin"), _rotation(shape.quat), shape.pos)
    ET.SubElement(ET.SubElement(element, "geometry"), kind, sizes)


def _rotation(quaternion: Array) -> Array:
    """Rotation (3, 3) from a quaternion, scalar first."""
    return pin.Quaternion(*quaternion).normalized().matrix()
