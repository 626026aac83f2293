"""Compilation of an MJCF, without the shapes whose mesh files are missing."""

import logging
from collections import defaultdict
from pathlib import Path

import mujoco

from sidegan.errors import RobotError
from sidegan.robot.meshes import is_there
from sidegan.robot.write_mjcf import mujoco_logged

Lost = dict[str, list[str]]  # missing mesh files by body


def compiled(path: Path) -> tuple[mujoco.MjModel, Lost, Lost]:
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
    """Like ``compiled``, without geoms whose mesh files are missing.

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
