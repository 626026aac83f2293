"""What Pixar's own library reads in the USD of an arm is the arm."""

import math

import numpy as np
import pytest
import torch
import trimesh

from sidegan.robot import Drives, load_robot, write_urdf
from sidegan.robot.consistency import about_the_centre
from sidegan.robot.write_usd import write_usd

from .test_looks import file  # noqa: F401

pytest.importorskip("urdf_usd_converter")


def opened(path):
    from pxr import Usd

    return Usd.Stage.Open(str(path))


def rotation(quaternion):
    from pxr import Gf

    return np.array(Gf.Matrix3d(Gf.Quatd(quaternion))).T


def test_links_friction_and_rotors_are_those_of_the_arm(tmp_path):
    from pxr import UsdPhysics

    arm = load_robot("kuka_lwr4")
    number = torch.arange(1, 8, dtype=torch.float64)
    drives = Drives(viscous=number, coulomb=0.1 * number, rotor_inertia=0.01 * number)
    write_urdf(arm, arm.inertial_parameters, tmp_path / "arm.urdf", drives)
    rotors = dict(zip(arm.joint_names, drives.rotor_inertia.tolist()))
    write_usd(tmp_path / "arm.urdf", arm.urdf, rotors, tmp_path / "arm.usdc")
    assert {path.name for path in tmp_path.iterdir()} == {"arm.urdf", "arm.usdc"}
    stage = opened(tmp_path / "arm.usdc")
    prims = {prim.GetName(): prim for prim in stage.Traverse()}
    centres, inertias = about_the_centre(arm.inertial_parameters)
    for k, (link, joint) in enumerate(zip(arm.link_names, arm.joint_names)):
        body = UsdPhysics.MassAPI(prims[link])
        assert body.GetMassAttr().Get() == pytest.approx(float(arm.inertial_parameters[k, 0]), rel=1e-6)
        np.testing.assert_allclose(body.GetCenterOfMassAttr().Get(), centres[k], atol=1e-6)
        turn = rotation(body.GetPrincipalAxesAttr().Get())
        found = turn @ np.diag(body.GetDiagonalInertiaAttr().Get()) @ turn.T
        np.testing.assert_allclose(found, inertias[k], atol=1e-5)
        values = {name: prims[joint].GetAttribute(f"newton:{name}").Get() for name in NEWTON}
        assert values["damping"] == pytest.approx((k + 1) * math.pi / 180, rel=1e-6)  # N·m·s per degree
        assert values["friction"] == pytest.approx(0.1 * (k + 1), rel=1e-6)
        assert values["armature"] == pytest.approx(0.01 * (k + 1), rel=1e-6)


NEWTON = ("damping", "friction", "armature")


def test_meshes_are_in_the_file_and_lost_ones_are_left_out(file, tmp_path):  # noqa: F811
    from pxr import UsdGeom

    (tmp_path / "else").mkdir()
    copied = tmp_path / "else" / "copied.urdf"
    copied.write_text(file.read_text())
    trimesh.creation.box((1, 2, 3)).export(tmp_path / "plate.stl")  # of scale 0.1 in the description
    write_usd(copied, file, {}, tmp_path / "two.usda")
    stage = opened(tmp_path / "two.usda")
    (mesh,) = [UsdGeom.Mesh(prim) for prim in stage.Traverse() if prim.IsA(UsdGeom.Mesh)]
    box = UsdGeom.BBoxCache(0, ["default", "render"]).ComputeLocalBound(mesh.GetPrim()).ComputeAlignedRange()
    np.testing.assert_allclose(box.GetSize(), [0.1, 0.2, 0.3], atol=1e-6)
