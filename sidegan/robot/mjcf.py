"""Conversion of MJCF to URDF: MuJoCo compiles it, and bodies, joints and shapes are written out."""

import logging
import xml.etree.ElementTree as ET
from collections import defaultdict
from pathlib import Path

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from sidegan.base.names import listed
from sidegan.errors import RobotError
from sidegan.robot.arm import FilePlane
from sidegan.robot.locking import write_placement
from sidegan.robot.meshes import is_there
from sidegan.robot.mjcf_shapes import plane_of, turn_of, write_shape
from sidegan.robot.mujoco_log import mujoco_logged
from sidegan.robot.xml import Source, words

_log = logging.getLogger(__name__)
Vector = NDArray[np.float64]
Lost = dict[str, list[str]]  # missing mesh files by body
_KINDS = {
    int(mujoco.mjtJoint.mjJNT_FREE): "floating",
    int(mujoco.mjtJoint.mjJNT_BALL): "floating",
    int(mujoco.mjtJoint.mjJNT_SLIDE): "prismatic",
    int(mujoco.mjtJoint.mjJNT_HINGE): "revolute",
}
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
    model, missing, hidden = _compiled(path)
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


def _compiled(path: Path) -> tuple[mujoco.MjModel, Lost, Lost]:
    """The model of a file, and missing meshes by body: those that collide, and those only shown."""
    try:
        with mujoco_logged(path, logging.WARNING):
            try:
                return mujoco.MjModel.from_xml_path(str(path)), {}, {}
            except ValueError:
                if found := _without_lost(path):
                    return found
                raise
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise RobotError(f"{path}: MuJoCo refuses it: {' '.join(str(error).split())}") from error


def _without_lost(path: Path) -> tuple[mujoco.MjModel, Lost, Lost] | None:
    """Like ``_compiled``, without geoms whose mesh files are missing.

    None if no file is missing, or if a body's mass depends on a missing one.
    """
    spec = mujoco.MjSpec.from_file(str(path))

    def lost(folder: str, *files: str) -> bool:
        return any(file and not is_there(Path(spec.modelfiledir, folder, file)) for file in files)

    meshes = {
        mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes if lost(spec.meshdir, mesh.file)
    }
    textures = {x.name: x for x in spec.textures if lost(spec.texturedir, x.file, *x.cubefiles)}
    if not (meshes or textures):
        return None
    colliding, shown = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
    for geom in [geom for geom in spec.geoms if geom.meshname in meshes]:
        if _weighs(spec, geom):
            return None
        where = colliding if geom.contype or geom.conaffinity else shown
        where[geom.parent.name].append(meshes[geom.meshname].file)
        spec.delete(geom)
    for material in spec.materials:
        material.textures = ["" if name in textures else name for name in material.textures]
    for asset in (*meshes.values(), *textures.values()):
        spec.delete(asset)
    return spec.compile(), dict(colliding), dict(shown)


def _weighs(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Whether a geom contributes to the mass of its body."""
    body = geom.parent
    first, last = spec.compiler.inertiagrouprange
    always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    own = body.explicitinertial and not always
    return body.name != "world" and not own and geom.mass != 0 and first <= geom.group <= last


class _Writer:
    """Writes a compiled model as URDF."""

    def __init__(self, model: mujoco.MjModel, path: Path) -> None:
        self.model = model
        self.root = ET.Element("robot", name=model.names.split(b"\0")[0].decode() or path.stem)
        self.dropped: list[str] = []
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
        dropped = [i for i in np.flatnonzero(model.eq_active0).tolist() if not self._written(i)]
        if dropped:
            names = listed([self.name("equality", i) for i in dropped])
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
        if element.get("type") == "floating":
            return
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

    def _written(self, equality: int) -> bool:
        """Whether an equality constraint is written as a mimic joint: an active one between two joints."""
        model = self.model
        of_joints = int(model.eq_type[equality]) == int(mujoco.mjtEq.mjEQ_JOINT)
        return of_joints and bool(model.eq_active0[equality]) and model.eq_obj2id[equality] >= 0

    def _mimics(self) -> None:
        """Write joints that an equality constraint couples to another as mimic joints."""
        model = self.model
        joints = {j.get("name"): j for j in self.root.findall("joint")}
        for i in range(model.neq):
            if self._written(i):
                follower, leader = (self.name("joint", ids[i]) for ids in (model.eq_obj1id, model.eq_obj2id))
                offset, factor = (repr(float(x)) for x in model.eq_data[i, :2])
                ET.SubElement(joints[follower], "mimic", joint=leader, multiplier=factor, offset=offset)


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
