"""Compilation of an MJCF by MuJoCo, without the shapes whose mesh files are missing."""

import logging
import warnings
from collections import defaultdict
from pathlib import Path

import mujoco

from sidegan.errors import RobotError
from sidegan.robot.meshes import is_there
from sidegan.robot.write_mjcf import mujoco_logged

_log = logging.getLogger(__name__)
Lost = dict[str, list[str]]  # missing mesh files by body


def compile_mjcf(path: Path) -> tuple[mujoco.MjSpec, mujoco.MjModel, Lost, Lost]:
    """A file's specification and model, and missing meshes: those that collide, and those only shown.

    Elements without a name get one; their ``id`` is their number in the model. MuJoCo's warnings are logged.

    Raises:
        RobotError: when MuJoCo refuses the file.
    """
    colliding: Lost = {}
    shown: Lost = {}
    try:
        with mujoco_logged(path, logging.WARNING), warnings.catch_warnings(record=True) as issued:
            warnings.simplefilter("always")
            spec = mujoco.MjSpec.from_file(str(path))
            _remove_textures(spec)
            try:
                model = spec.compile()
            except ValueError:
                colliding, shown = _remove_lost(spec)
                model = spec.compile()
    except (ValueError, RuntimeError, mujoco.FatalError) as error:
        raise RobotError(f"{path}: MuJoCo refuses it: {' '.join(str(error).split())}") from error
    for warning in issued:
        _log.warning("%s: %s", path, warning.message)
    _name_all(spec)
    return spec, model, colliding, shown


def _remove_textures(spec: mujoco.MjSpec) -> None:
    """Remove what only pictures need, and whose files may be missing."""
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in spec.textures:
        spec.delete(texture)


def _remove_lost(spec: mujoco.MjSpec) -> tuple[Lost, Lost]:
    """Remove meshes whose files are missing, and their shapes, unless a body's mass depends on one."""
    folder = Path(spec.modelfiledir, spec.meshdir)
    absent = [mesh for mesh in spec.meshes if mesh.file and not is_there(folder / mesh.file)]
    files = {mesh.name or Path(mesh.file).stem: mesh.file for mesh in absent}
    geoms = [geom for geom in spec.geoms if geom.meshname in files]
    colliding, shown = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
    if any(_weighs(spec, geom) for geom in geoms):
        return {}, {}
    for geom in geoms:
        where = colliding if geom.contype or geom.conaffinity else shown
        where[geom.parent.name].append(files[geom.meshname])
    for element in (*geoms, *absent):
        spec.delete(element)
    return dict(colliding), dict(shown)


def _weighs(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Whether a geom contributes to the mass of its body."""
    body = geom.parent
    first, last = spec.compiler.inertiagrouprange
    always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    own = body.explicitinertial and not always
    return body.name != "world" and not own and geom.mass != 0 and first <= geom.group <= last


def _name_all(spec: mujoco.MjSpec) -> None:
    """Name elements without a name by their kind and number, or the like if another has that name."""
    named = spec.bodies, spec.joints, spec.geoms, spec.tendons, spec.actuators, spec.equalities, spec.keys
    for elements in named:
        taken = {element.name for element in elements}
        for element in (element for element in elements if not element.name):
            name = f"{type(element).__name__.removeprefix('Mjs').lower()}_{element.id}"
            while name in taken:
                name += "_"
            element.name = name
