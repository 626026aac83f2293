"""An MJCF without what its lost files would show, where neither masses nor joints depend on them."""

from collections import defaultdict
from pathlib import Path

import mujoco

from sidegan.robot.meshes import is_there

Lost = dict[str, list[str]]  # files by the body that they show


def without_lost(path: Path) -> tuple[mujoco.MjModel, Lost, Lost] | None:
    """A model whose geoms of lost meshes are left out; which of them collided, and which were for show.

    None where no file is lost, or a lost mesh has a mass that counts.

    Raises:
        ValueError: when MuJoCo refuses the rest.
    """
    spec = mujoco.MjSpec.from_file(str(path))
    there, seen = Path(spec.modelfiledir, spec.meshdir), Path(spec.modelfiledir, spec.texturedir)
    meshes = {mesh.name or Path(mesh.file).stem: mesh for mesh in spec.meshes if _lost(there, mesh.file)}
    skins = [skin for skin in spec.skins if _lost(there, skin.file)]
    pictures = [
        texture
        for texture in spec.textures
        if any(_lost(seen, file) for file in (texture.file, *texture.cubefiles))
    ]
    if not (meshes or pictures or skins):
        return None
    colliding, shown = defaultdict[str, list[str]](list), defaultdict[str, list[str]](list)
    for geom in [geom for geom in spec.geoms if geom.meshname in meshes]:
        if _weighs(spec, geom):
            return None
        where = colliding if geom.contype or geom.conaffinity else shown
        where[geom.parent.name].append(meshes[geom.meshname].file)
        spec.delete(geom)
    names = {picture.name for picture in pictures}
    for material in spec.materials:
        material.textures = ["" if name in names else name for name in material.textures]
    for one in (*meshes.values(), *pictures, *skins):
        spec.delete(one)
    return spec.compile(), dict(colliding), dict(shown)


def _weighs(spec: mujoco.MjSpec, geom: mujoco.MjsGeom) -> bool:
    """Whether the mass of a body comes from a geom of it."""
    body, (first, last) = geom.parent, spec.compiler.inertiagrouprange
    always = spec.compiler.inertiafromgeom == mujoco.mjtInertiaFromGeom.mjINERTIAFROMGEOM_TRUE
    own = body.explicitinertial and not always
    return body.name != "world" and not own and geom.mass != 0 and first <= geom.group <= last


def _lost(folder: Path, file: str) -> bool:
    """Whether a file that is named is not there."""
    return bool(file) and not is_there(folder / file)
