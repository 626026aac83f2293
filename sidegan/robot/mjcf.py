"""Conversion of MJCF to URDF: MuJoCo compiles it, and bodies, joints and shapes are written out."""

import logging
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from sidegan.base.names import listed
from sidegan.robot.arm import FilePlane
from sidegan.robot.meshes import kept_mesh
from sidegan.robot.mjcf_files import compiled
from sidegan.robot.placement import write_placement
from sidegan.robot.xml import Source, words

_log = logging.getLogger(__name__)
Vector = NDArray[np.float64]
_KINDS = {
    int(mujoco.mjtJoint.mjJNT_FREE): "floating",
    int(mujoco.mjtJoint.mjJNT_BALL): "floating",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
    int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
}
_SHAPES = {
    int(mujoco.mjtGeom.mjGEOM_SPHERE): "sphere",
    int(mujoco.mjtGeom.mjGEOM_CAPSULE): "capsule",
    int(mujoco.mjtGeom.mjGEOM_CYLINDER): "cylinder",
    int(mujoco.mjtGeom.mjGEOM_BOX): "box",
    int(mujoco.mjtGeom.mjGEOM_ELLIPSOID): "box",  # around it
    int(mujoco.mjtGeom.mjGEOM_MESH): "mesh",
}
_HIDDEN = 3  # first group of geoms that MuJoCo's viewers hide by default
_ON_JOINTS = {int(mujoco.mjtTrn.mjTRN_JOINT), int(mujoco.mjtTrn.mjTRN_JOINTINPARENT)}
_MOTORS = {  # gain, bias and dynamics of actuators whose control range bounds their force
    (int(mujoco.mjtGain.mjGAIN_FIXED), int(mujoco.mjtBias.mjBIAS_NONE), int(dynamics))
    for dynamics in (mujoco.mjtDyn.mjDYN_NONE, mujoco.mjtDyn.mjDYN_FILTER, mujoco.mjtDyn.mjDYN_FILTEREXACT)
}


def read_mjcf(path: Path) -> Source:
    """A description from an MJCF file, with links named like bodies.

    MJCF has no velocity limits; torque limits are the joints' or else the actuators'. Equality constraints
    between joints become mimic joints. Height fields are dropped; fixed planes are listed separately.
    """
    model, missing, hidden = compiled(path)
    writer = _Writer(model, path)
    if ignored := writer.ignored():
        _log.warning("%s: torques and their limits do not include %s", path, ignored)
    notes = writer.notes()
    if hidden:
        notes.append(f"not shown, since the mesh files are missing: {listed(list(hidden))}")
    return Source(
        text=ET.tostring(writer.root, encoding="utf-8"),
        root=writer.root,
        notes=tuple(notes),
        missing=missing,
        planes=tuple(writer.planes),
        gravity=tuple(map(float, model.opt.gravity)),
        postures=writer.postures(),
    )


class _Writer:
    """Writes a compiled model as URDF."""

    def __init__(self, model: mujoco.MjModel, path: Path) -> None:
        self.model = model
        self.root = ET.Element("robot", name=model.names.split(b"\0")[0].decode() or path.stem)
        self.dropped: list[str] = []  # shapes
        self.uncoupled: list[str] = []  # constraints that no mimic joint can express
        self.planes: list[FilePlane] = []
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self._efforts = _efforts(model)
        for body in range(model.nbody):
            link = ET.SubElement(self.root, "link", name=self.name("body", body))
            self._inertia(link, body)
            first = model.body_geomadr[body]
            for geom in range(first, first + model.body_geomnum[body]):
                if plane := plane_of(model, data, geom):
                    self.planes.append(plane)
                elif not write_shape(link, model, geom):
                    self.dropped.append(f"{self.name('geom', geom)} of {link.get('name')}")
            if body:
                self._joints(body)
        self._mimics()
        for pair in model.exclude_signature.tolist():  # two bodies in one number
            a, b = (self.name("body", body) for body in divmod(pair, 1 << 16))
            ET.SubElement(self.root, "disable_collisions", link1=a, link2=b, reason="contact exclude")

    def name(self, kind: str, index: int) -> str:
        """Name of an object; its kind and number if it has none."""
        code = getattr(mujoco.mjtObj, f"mjOBJ_{kind.upper()}")
        return mujoco.mj_id2name(self.model, code, index) or f"{kind}_{index}"

    def notes(self) -> list[str]:
        """Notes on what could not be carried over."""
        model = self.model
        notes = []
        if self.dropped:
            notes.append(f"unsupported shapes left out: {listed(self.dropped)}")
        if model.dof_armature.any():
            notes.append("rotor inertias (armature) are not part of the rigid model")
        if self.uncoupled:
            names = listed(self.uncoupled)
            notes.append(f"constraints left out, so that trajectories may break them: {names}")
        if floats := np.flatnonzero(model.body_gravcomp).tolist():
            names = listed([self.name("body", body) for body in floats])
            notes.append(f"gravity of {names} is compensated (gravcomp): actuator torques exclude it")
        return notes

    def ignored(self) -> str:
        """Torques and forces that the rigid model lacks; empty if there are none."""
        model = self.model
        springs = [self.name("joint", joint) for joint in np.flatnonzero(model.jnt_stiffness).tolist()]
        found = [f"springs of {listed(springs)} (stiffness)"] if springs else []
        if model.opt.density or model.opt.viscosity:
            found.append("drag of the medium (density, viscosity)")
        return " and ".join(found)

    def postures(self) -> dict[str, dict[str, float]]:
        """Positions of revolute and prismatic joints [rad or m] by keyframe and name."""
        model = self.model
        movable = [j for j in range(model.njnt) if _KINDS[int(model.jnt_type[j])] != "floating"]
        return {
            self.name("key", k): {
                self.name("joint", j): float(model.key_qpos[k, model.jnt_qposadr[j]]) for j in movable
            }
            for k in range(model.nkey)
        }

    def _inertia(self, link: ET.Element, body: int) -> None:
        model = self.model
        if not model.body_mass[body]:
            return
        inertial = ET.SubElement(link, "inertial")
        origin = ET.SubElement(inertial, "origin")
        write_placement(origin, turn_of(model.body_iquat[body]), model.body_ipos[body])
        ET.SubElement(inertial, "mass", value=repr(float(model.body_mass[body])))
        xx, yy, zz = words(model.body_inertia[body]).split()
        ET.SubElement(inertial, "inertia", ixx=xx, iyy=yy, izz=zz, ixy="0", ixz="0", iyz="0")

    def _joints(self, body: int) -> None:
        """Write the joints between a body and its parent; all but the last lead to auxiliary links."""
        model = self.model
        parent, child = self.name("body", model.body_parentid[body]), self.name("body", body)
        turn = turn_of(model.body_quat[body])
        place = model.body_pos[body].copy()
        count, first = model.body_jntnum[body], model.body_jntadr[body]
        for joint in range(first, first + count):
            anchor = model.jnt_pos[joint].copy()
            axis = model.jnt_axis[joint]
            kind = _KINDS[int(model.jnt_type[joint])]
            if kind == "floating":
                anchor = np.zeros(3)
            direct = joint == first + count - 1 and not anchor.any()
            name = self.name("joint", joint)
            after = child if direct else f"{child}/{name}"
            if not direct:
                ET.SubElement(self.root, "link", name=after)
            at = place + turn @ anchor
            around = turn
            reference = 0.0 if kind == "floating" else float(model.qpos0[model.jnt_qposadr[joint]])
            if kind == "prismatic":
                at = at - turn @ axis * reference
            elif kind == "revolute":
                around = turn @ pin.exp3(-reference * axis)
            element = self._joint(name, kind, parent, after, around, at)
            if kind != "floating":
                self._limits(element, joint)
            if direct:
                return
            parent = after
            turn = np.eye(3)
            place = -anchor
        self._joint(f"{child}/fixed", "fixed", parent, child, turn, place)

    def _joint(
        self, name: str, kind: str, parent: str, child: str, turn: Vector, place: Vector
    ) -> ET.Element:
        joint = ET.SubElement(self.root, "joint", name=name, type=kind)
        ET.SubElement(joint, "parent", link=parent)
        ET.SubElement(joint, "child", link=child)
        write_placement(ET.SubElement(joint, "origin"), turn, place)
        return joint

    def _limits(self, element: ET.Element, joint: int) -> None:
        """Write the axis, dynamics and limits of a joint."""
        model = self.model
        ET.SubElement(element, "axis", xyz=words(model.jnt_axis[joint]))
        dof = model.jnt_dofadr[joint]
        stated = {
            "damping": model.dof_damping[dof],
            "friction": model.dof_frictionloss[dof],
            "armature": model.dof_armature[dof],
        }
        ET.SubElement(element, "dynamics", {name: repr(float(np.ravel(x)[0])) for name, x in stated.items()})
        limit = ET.SubElement(element, "limit", velocity="0", effort=repr(self._efforts.get(joint, 0.0)))
        if model.jnt_limited[joint]:
            lower, upper = model.jnt_range[joint]
            limit.set("lower", repr(float(lower)))
            limit.set("upper", repr(float(upper)))
        elif element.get("type") == "revolute":
            element.set("type", "continuous")

    def _mimics(self) -> None:
        """Write joints that an equality constraint couples to another as mimic joints."""
        model = self.model
        joints = {j.get("name"): j for j in self.root.findall("joint")}
        for i in np.flatnonzero(model.eq_active0).tolist():
            if int(model.eq_type[i]) == int(mujoco.mjtEq.mjEQ_JOINT) and model.eq_obj2id[i] >= 0:
                follower, leader = (self.name("joint", ids[i]) for ids in (model.eq_obj1id, model.eq_obj2id))
                offset, factor = (repr(float(x)) for x in model.eq_data[i, :2])
                ET.SubElement(joints[follower], "mimic", joint=leader, multiplier=factor, offset=offset)
            else:
                self.uncoupled.append(self.name("equality", i))


def write_shape(link: ET.Element, model: mujoco.MjModel, geom: int) -> bool:
    """Write a geom as a collision or visual shape, or both; False if URDF has no such shape."""
    kind = _SHAPES.get(int(model.geom_type[geom]))
    if kind is None:
        return False
    collides = bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
    shown = model.geom_group[geom] < _HIDDEN and kind == "mesh"
    for tag in ["collision"] * collides + ["visual"] * (shown or not collides):
        _write(ET.SubElement(link, tag), kind, model, geom)
    return True


def plane_of(model: mujoco.MjModel, data: mujoco.MjData, geom: int) -> FilePlane | None:
    """Unit normal of a fixed plane and its offset along the normal [m]; None for other geoms."""
    plane = int(model.geom_type[geom]) == int(mujoco.mjtGeom.mjGEOM_PLANE)
    if not plane or model.body_weldid[model.geom_bodyid[geom]]:
        return None
    x, y, z = normal = data.geom_xmat[geom].reshape(3, 3)[:, 2].tolist()
    return x, y, z, float(data.geom_xpos[geom] @ normal)


def _write(element: ET.Element, kind: str, model: mujoco.MjModel, geom: int) -> None:
    """Write the origin and geometry of a shape."""
    x, y, z = (float(size) for size in model.geom_size[geom])
    if kind == "mesh":  # as MuJoCo compiled it: scaled, and in its principal axes of inertia
        mesh = model.mesh(int(model.geom_dataid[geom]))
        vertex, face = int(mesh.vertadr[0]), int(mesh.faceadr[0])
        vertices = model.mesh_vert[vertex : vertex + int(mesh.vertnum[0])]
        faces = model.mesh_face[face : face + int(mesh.facenum[0])]
        sizes = {"filename": str(kept_mesh(vertices, faces))}
    elif kind == "box":
        sizes = {"size": words([2 * x, 2 * y, 2 * z])}
    else:
        sizes = {"radius": repr(x)} | ({} if kind == "sphere" else {"length": repr(2 * y)})
    origin = ET.SubElement(element, "origin")
    write_placement(origin, turn_of(model.geom_quat[geom]), model.geom_pos[geom])
    ET.SubElement(ET.SubElement(element, "geometry"), kind, sizes)


def turn_of(quaternion: NDArray[np.float64]) -> NDArray[np.float64]:
    """Rotation (3, 3) from a quaternion, scalar first."""
    return pin.Quaternion(*quaternion).normalized().matrix()


def _forces(model: mujoco.MjModel, actuator: int) -> Vector:
    """Smallest and largest force of an actuator before its gear, (2,), from its force or control range.

    The control range bounds the force only of motors, whose force is a fixed multiple of the control.
    """
    found = np.array([-np.inf, np.inf])
    kinds = model.actuator_gaintype, model.actuator_biastype, model.actuator_dyntype
    if model.actuator_ctrllimited[actuator] and tuple(int(kind[actuator]) for kind in kinds) in _MOTORS:
        found = np.sort(model.actuator_gainprm[actuator, 0] * model.actuator_ctrlrange[actuator])
    if model.actuator_forcelimited[actuator]:
        found = np.clip(found, *model.actuator_forcerange[actuator])
    return found


def _efforts(model: mujoco.MjModel) -> dict[int, float]:
    """Largest torque or force [N·m or N] available to each joint in both directions, if it is limited.

    Forces of a joint's actuators add up, and the joint's own range clips the sum.
    """
    ranges: dict[int, Vector] = {}
    for i in range(model.nu):
        if int(model.actuator_trntype[i]) in _ON_JOINTS:
            joint = int(model.actuator_trnid[i, 0])
            gear = model.actuator_gear[i, 0]
            force = np.sort(_forces(model, i) * gear) if gear else np.zeros(2)
            ranges[joint] = ranges.get(joint, np.zeros(2)) + force
    for joint in np.flatnonzero(model.jnt_actfrclimited).tolist():
        lower, upper = model.jnt_actfrcrange[joint]
        least, most = ranges.get(joint, (-np.inf, np.inf))
        ranges[joint] = np.array([max(lower, least), min(upper, most)])
    sides = {joint: np.abs(force) for joint, force in ranges.items()}
    largest = {joint: float(x.min() or x.max()) for joint, x in sides.items()}  # some push one way only
    return {joint: force for joint, force in largest.items() if np.isfinite(force)}
