"""An arm as OpenUSD, from its URDF: by Newton's converter, the extra ``usd``."""

import shutil
import tempfile
import xml.etree.ElementTree as ET
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path

from sidegan.base.storage import replacing
from sidegan.errors import RobotError
from sidegan.robot.meshes import find_mesh


def usd_installed() -> bool:
    """Whether the converter is there."""
    return find_spec("urdf_usd_converter") is not None


def write_usd(urdf: Path, source: Path, rotor_inertia: Mapping[str, float], path: Path) -> None:
    """Write a URDF with its friction as one USD file; appears whole or not at all.

    Args:
        urdf: the description.
        source: the one that it was made from, beside which its meshes are; lost ones are left out.
        rotor_inertia: by joint [kg·m² or kg], which a URDF cannot hold.
        path: of the file, ``.usd``, ``.usdc`` or ``.usda``.

    Raises:
        RobotError: when the converter cannot read the description.
    """
    import usdex.core
    from pxr import Usd, UsdPhysics
    from urdf_usd_converter import Converter

    usdex.core.activateDiagnosticsDelegate()
    usdex.core.setDiagnosticsLevel(usdex.core.DiagnosticsLevel.eError)
    with replacing(path) as draft, tempfile.TemporaryDirectory() as folder:
        found, made = Path(folder) / urdf.name, Path(folder) / f"made{path.suffix}"
        _with_meshes(urdf, source).write(found)
        try:
            asset = Converter(layer_structure=False).convert(str(found), folder)
        except Exception as error:  # a ValueError, or one of the C++ libraries' own
            reason = " ".join(str(error).split())
            raise RobotError(f"{urdf} cannot be converted to USD: {reason}") from error
        stage = Usd.Stage.Open(asset.path)
        for prim in stage.Traverse():
            name = prim.GetMetadata("displayName") or prim.GetName()  # what is no name in USD is shown so
            if prim.IsA(UsdPhysics.Joint) and name in rotor_inertia:
                prim.ApplyAPI("NewtonJointAPI")
                prim.GetAttribute("newton:armature").Set(rotor_inertia[name])
        stage.GetRootLayer().Export(str(made))
        shutil.copyfile(made, draft)


def _with_meshes(urdf: Path, source: Path) -> "ET.ElementTree[ET.Element]":
    """A description whose meshes are named by where they are, without those that are not there."""
    tree = ET.parse(urdf)
    for link in tree.iter("link"):
        for shape in [*link.findall("visual"), *link.findall("collision")]:
            for mesh in shape.iter("mesh"):
                file = find_mesh(mesh.get("filename", ""), source)
                if file is None:
                    link.remove(shape)
                else:
                    mesh.set("filename", str(file))
    return tree
