"""Conversion of MJCF to URDF: MuJoCo compiles it, and bodies, joints and shapes are written out."""

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
from sidegan.robot.mjcf_forces import efforts, name_of, not_read
from sidegan.robot.placement import write_placement
from sidegan.robot.xml import Source, words

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


def read_mjcf(path: Path) -> Source:
    """A description from an MJCF file, with links named like bodies.

    MJCF has no velocity limits; torque limits are the joints' or else the actuators'. Equality constraints
    of two joints become mimic joints, others loops. Height fields are dropped; fixed planes are listed
    separately.
    """
    model, missing, hidden = compiled(path)
    writer = _Writer(model, path)
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
        passive=writer.passive,
    )


class _Writer:
    """Writes a compiled model as URDF."""

    def __init__(self, model: mujoco.MjModel, path: Path) -> None:
        self.model = model
        self.root = ET.Element("robot", name=model.names.split(b"\0")[0].decode() or path.stem)
        self.dropped: list[str] = []  # shapes
        self.planes: list[FilePlane] = []
        data = mujoco.MjData(model)
        mujoco.mj_kinematics(model, data)
        self._efforts = efforts(model)
        self._motors, self.passive = not_read(model)
        for body in range(model.nbody):
            link = ET.SubElement(self.root, "link", name=name_of(self.model, "body", body))
            self._inertia(link, body)
            first = model.body_geomadr[body]
            for geom in range(first, first + model.body_geomnum[body]):
                if plane := plane_of(model, data, geom):
                    self.planes.append(plane)
                elif not write_shape(link, model, geom):
                    self.dropped.append(f"{name_of(self.model, 'geom', geom)} of {link.get('name')}")
            if body:
                self._joints(body)
        self._constraints()
        for pair in model.exclude_signature.tolist():  # two bodies in one number
            a, b = (name_of(self.model, "body", body) for body in divmod(pair, 1 << 16))
            ET.SubElement(self.root, "disable_collisions", link1=a, link2=b, reason="contact exclude")

    def notes(self) -> list[str]:
        """Notes on what could not be carried over."""
        model = self.model
        notes = []
        if self.dropped:
            notes.append(f"unsupported shapes left out: {listed(self.dropped)}")
        if model.dof_armature.any():
            notes.append("rotor inertias (armature) are not part of the rigid model")
        if floats := np.flatnonzero(model.body_gravcomp).tolist():
            names = listed([name_of(self.model, "body", body) for body in floats])
            notes.append(f"gravity of {names} is compensated (gravcomp): actuator torques exclude it")
        return notes

    def postures(self) -> dict[str, dict[str, float]]:
        """Positions of revolute and prismatic joints [rad or m] by keyframe and name."""
        model = self.model
        movable = [j for j in range(model.njnt) if _KINDS[int(model.jnt_type[j])] != "floating"]
        return {
            name_of(self.model, "key", k): {
                name_of(self.model, "joint", j): float(model.key_qpos[k, model.jnt_qposadr[j]])
                for j in movable
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
        parent, child = (
            name_of(self.model, "body", model.body_parentid[body]),
            name_of(self.model, "body", body),
        )
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
            name = name_of(self.model, "joint", joint)
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
        for motor, joints in self._motors.items():
            if element.get("name") in joints:
                limit.set("not_read", motor)
        if model.jnt_limited[joint]:
            lower, upper = model.jnt_range[joint]
            limit.set("lower", repr(float(lower)))
            limit.set("upper", repr(float(upper)))
        elif element.get("type") == "revolute":
            element.set("type", "continuous")

    def _constraints(self) -> None:
        """Write equality constraints: of two joints as mimic joints, others as loops."""
        model = self.model
        joints = {j.get("name"): j for j in self.root.findall("joint")}
        for i in np.flatnonzero(model.eq_active0).tolist():
            kind = mujoco.mjtEq(int(model.eq_type[i]))
            ids = [int(x[i]) for x in (model.eq_obj1id, model.eq_obj2id)]
            if kind == mujoco.mjtEq.mjEQ_JOINT and ids[1] >= 0:
                follower, leader = (name_of(self.model, "joint", joint) for joint in ids)
                offset, factor = (repr(float(x)) for x in model.eq_data[i, :2])
                ET.SubElement(joints[follower], "mimic", joint=leader, multiplier=factor, offset=offset)
                continue
            loop = ET.SubElement(self.root, "loop_joint", name=name_of(self.model, "equality", i))
            for body in self._bodies(kind, ids, int(model.eq_objtype[i])):
                ET.SubElement(loop, "link", link=name_of(self.model, "body", body))

    def _bodies(self, kind: mujoco.mjtEq, ids: list[int], of: int) -> list[int]:
        """The two bodies that an equality constraint ties; none if it is on tendons, or on a mocap body."""
        model = self.model
        if kind == mujoco.mjtEq.mjEQ_JOINT:  # of one joint, which it holds
            body = int(model.jnt_bodyid[ids[0]])
            return [body, int(model.body_parentid[body])]
        if kind not in (mujoco.mjtEq.mjEQ_CONNECT, mujoco.mjtEq.mjEQ_WELD):
            return []
        bodies = [int(model.site_bodyid[x]) for x in ids] if of == int(mujoco.mjtObj.mjOBJ_SITE) else ids
        return [] if any(model.body_mocapid[body] >= 0 for body in bodies) else bodies


def write_shape(link: ET.Element, model: mujoco.MjModel, geom: int) -> bool:
    """Write a geom as a collision or visual shape, or both; False if URDF has no such shape."""
    kind = _SHAPES.get(int(model.geom_type[geom]))
    if kind is None:
        return False
    paired = geom in model.pair_geom1 or geom in model.pair_geom2
    collides = paired or bool(model.geom_contype[geom] or model.geom_conaffinity[geom])
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
