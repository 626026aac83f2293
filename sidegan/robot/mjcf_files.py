"""Compilation of an MJCF by MuJoCo, without the shapes whose mesh files are missing."""

import logging
import warnings
from collections import defaultdict
from pathlib import Path
from typing import NamedTuple

import mujoco

from sidegan.errors import RobotError
from sidegan.robot.meshes import is_there
from sidegan.robot.write_mjcf import mujoco_logged

_log = logging.getLogger(__name__)
Lost = dict[str, list[str]]  # missing mesh files by body


class Compiled(NamedTuple):
    """An MJCF as MuJoCo reads it; an element of the specification has its number in the model as ``id``."""

    spec: mujoco.MjSpec  # elements without a name have their kind and number as one
    model: mujoco.MjModel
    colliding: Lost  # left out
    shown: Lost  # left out, too, and of no use for collisions


def compile_mjcf(path: Path) -> Compiled:
    """An MJCF, compiled; MuJoCo's warnings are logged.

    Raises:
        RobotError: when MuJoCo refuses it, with its words.
    """
    try:
        with mujoco_logged(path, logging.WARNING), warnings.catch_warnings(record=True) as issued:
            warnings.simplefilter("always")
            spec = mujoco.MjSpec.from_file(str(path))
            _remove_textures(spec)
            try:
                found = Compiled(spec, spec.compile(), {}, {})
            except ValueError:
                lost = _remove_lost_meshes(spec)
                found = Compiled(spec, spec.compile(), *lost)
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise RobotError(f"{path}: MuJoCo refuses it: {' '.join(str(error).split())}") from error
    for warning in issued:
        _log.warning("%s: %s", path, warning.message)
    _name_all(spec)
    return found


def _remove_textures(spec: mujoco.MjSpec) -> None:
    """Remove what only a picture needs, and whose files may be missing."""
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in spec.textures:
        spec.delete(texture)


def _remove_lost_meshes(spec: mujoco.MjSpec) -> tuple[Lost, Lost]:
    """Remove meshes without a file and their shapes, unless a body's mass depends on one.

    Returns the missing files of shapes that collide, and of those only shown.
    """
    folder = Path(spec.modelfiledir, spec.meshdir)
    meshes = {
        mesh.name or Path(mesh.file).stem: mesh
        for mesh in spec.meshes
        if mesh.file and not is_there(folder / mesh.file)
    }
    colliding, shown = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
    geoms = [geom for geom in spec.geoms if geom.meshname in meshes]
    if any(_weighs(spec, geom) for geom in geoms):
        return {}, {}
    for geom in geoms:
        where = colliding if geom.contype or geom.conaffinity else shown
        where[geom.parent.name].append(meshes[geom.meshname].file)
        spec.delete(geom)
    for mesh in meshes.values():
        spec.delete(mesh)
    return dict(colliding), dict(shown)


def _weighs(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Whether a geom contributes to the mass of its body."""
    body = geom.parent
    first, last = spec.compiler.inertiagrouprange
    always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    own = body.explicitinertial and not always
    return body.name != "world" and not own and geom.mass != 0 and first <= geom.group <= last


def _name_all(spec: mujoco.MjSpec) -> None:
    """Name elements that have no name."""
    kinds = {
        "body": spec.bodies,
        "joint": spec.joints,
        "geom": spec.geoms,
        "tendon": spec.tendons,
        "actuator": spec.actuators,
        "equality": spec.equalities,
        "key": spec.keys,
    }
    for kind, elements in kinds.items():
        for element in elements:
            element.name = element.name or f"{kind}_{element.id}"
