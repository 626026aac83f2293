"""The page on which an arm moves: its numbers are the motion's, and names are escaped."""

import base64
import json
import re
import shutil
import subprocess
import zlib
from dataclasses import replace
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import trimesh

from sidegan.motion.trajectory import Trajectory
from sidegan.report import viewer
from sidegan.report.viewer.page import fewer, region_surface, write_view
from sidegan.robot.visuals import Surface
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from tests.report.pages import Page

FAMILY = Trajectory(2, 3, 8.0)
REGIONS = (Plane((0.0, 0.0, 1.0), -0.5), Box((0.5, -0.1, 0.0), (0.9, 0.1, 0.3)))
TABLE = pd.DataFrame({"cond(YᵀY)": ["7", "8", "9"]}, pd.RangeIndex(1, 4, name="trajectory"))
RESIZED = """
let resets = 0;
const space = Object.assign(Object.create(Space.prototype), {
  canvas: {}, renderer: { setPixelRatio() {}, setSize() {} }, reset() { resets++; },
  camera: { aspect: 1, updateProjectionMatrix() {} },
});
for (const clientWidth of [800, 600, 900]) {
  space.canvas.parentElement = { clientWidth, clientHeight: 600 };
  space.resize();
}
console.log(resets, space.camera.aspect);
"""
EVIL = "</script><script>alert('joint & more')</script><!--"


@pytest.fixture(scope="module")
def coefficients():
    return 0.3 * np.random.default_rng(3).standard_normal((3, *FAMILY.shape))


@pytest.fixture(scope="module")
def write(tmp_path_factory, coefficients):
    """The text of a page with three trajectories."""

    def text(constraints, titles="123"):
        path = tmp_path_factory.mktemp("view") / "view.html"
        write_view(path, constraints, constraints.arm, FAMILY, coefficients, titles, TABLE)
        return path.read_text()

    return text


@pytest.fixture(scope="module")
def html(planar, write):
    return write(Constraints(planar, REGIONS))


@pytest.fixture(scope="module")
def shown(html):
    """The page's plain values and its arrays."""
    return unpacked(Page(html))


def unpacked(page):
    head = json.loads(page.held["data"])
    data = zlib.decompress(base64.b64decode(page.held["arrays"]))
    table = head["arrays"].items()
    return head, {name: np.frombuffer(data, kind, size, offset) for name, (kind, offset, size) in table}


def test_positions_and_shares_are_those_of_the_motion(planar, shown, coefficients):
    head, arrays = shown
    times = np.linspace(0, 8, head["samples"] + 1)
    motion = FAMILY.roll_out(coefficients, times)
    shares = {name: arrays[name].reshape(3, -1, 2) for name in head["signals"]}
    scales = {name: np.array(signal["scale"]) for name, signal in head["signals"].items()}
    position = np.array(head["middle"]) + shares["position"] * scales["position"]
    np.testing.assert_allclose(position, motion.position, atol=2e-4)
    np.testing.assert_allclose(shares["velocity"], motion.velocity / planar.velocity_limit, atol=1e-4)
    torque = Constraints(planar).body.torque(*motion[1:])
    np.testing.assert_allclose(shares["torque"], torque / planar.torque_limit, atol=1e-4)
    assert not any(head["signals"]["acceleration"]["limited"])  # none is stated
    assert np.abs(shares["acceleration"]).max((0, 1)) == pytest.approx([1, 1])


def test_acceleration_shares_are_relative_to_the_limit(planar, write):
    limited = replace(planar, acceleration_limit=np.array([5.0, np.inf]))
    head, _ = unpacked(Page(write(Constraints(limited))))
    signal = head["signals"]["acceleration"]
    assert signal["limited"] == [True, False] and signal["scale"][0] == 5


def test_the_closest_pair_is_that_of_the_check(planar, shown, coefficients):
    head, arrays = shown
    constraints = Constraints(planar, REGIONS)
    times = np.linspace(0, 8, head["samples"] + 1)
    positions = FAMILY.derivative(coefficients, times, 0).reshape(-1, 2)
    margins = constraints.at_rest(positions)
    distances = np.concatenate([margins["collision"], margins["keep_out"]], 1)
    names = [*constraints.labels["collision"], *constraints.labels["keep_out"]]
    np.testing.assert_allclose(arrays["distance"], distances.min(1), atol=1e-6)
    assert [head["pairs"][k] for k in arrays["pair"]] == [names[k] for k in distances.argmin(1)]


def test_names_are_escaped_in_the_viewer(planar, write):
    named = replace(planar, name=EVIL, joint_names=(EVIL, "b"), link_names=(EVIL, "b"))
    named = replace(named, parents=None, capsules=replace(planar.capsules, owners=(EVIL, "<b>", "&")))
    page = Page(write(Constraints(named), [EVIL, "2", "3"]))
    assert page.tags == Page(write(Constraints(planar))).tags
    head, _ = unpacked(page)
    assert head["joints"][0] == head["titles"][0] == EVIL


def test_the_viewer_loads_nothing_external(html):
    assert "default-src 'none'" in html and "SPDX-License-Identifier: MIT" in html  # of three.js
    assert Page(html).links == []
    assert len(html) < 2_000_000


def test_meshes_with_too_many_triangles_are_decimated_in_place():
    ball = trimesh.creation.icosphere(7, 0.1)
    whole = Surface(0, np.asarray(ball.vertices), np.asarray(ball.faces))
    assert len(whole.faces) > 200_000
    (less,) = fewer([whole])
    assert 20_000 < len(less.faces) <= 120_000
    np.testing.assert_allclose(np.linalg.norm(less.vertices, axis=1), 0.1, atol=1e-3)


def test_region_surfaces_face_outwards_and_enclose_the_region():
    points = np.random.default_rng(0).normal(size=(60, 3))
    hull = Convex(np.zeros((0, 4)), points)
    for region, volume in ((REGIONS[1], 0.4 * 0.2 * 0.3), (Sphere((1, 2, 3), 0.5), 0.52), (hull, None)):
        part = region_surface(region)
        a, b, c = (part.vertices[part.faces[:, k]] for k in range(3))
        found = float((np.cross(a, b) * c).sum() / 6)
        assert found > 0 and (volume is None or found == pytest.approx(volume, rel=0.02))


@pytest.mark.skipif(shutil.which("node") is None, reason="needs node")
def test_a_window_that_was_square_keeps_its_view_when_it_is_resized():
    scene = (Path(viewer.__file__).parent / "scene.js").read_text(encoding="utf-8")
    source = f"globalThis.window = {{}};{scene}{RESIZED}"
    ran = subprocess.run(["node", "-e", source], capture_output=True, text=True, check=True)
    assert ran.stdout.split() == ["0", "1.5"]


@pytest.mark.skipif(shutil.which("chromium") is None, reason="needs a browser")
def test_a_browser_renders_the_viewer(html, tmp_path):
    (tmp_path / "view.html").write_text(html)
    command = ["chromium", "--headless", "--no-sandbox", "--disable-gpu", "--disable-background-networking"]
    command += ["--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--virtual-time-budget=8000"]
    command += [f"--user-data-dir={tmp_path / 'profile'}", "--dump-dom", (tmp_path / "view.html").as_uri()]
    shown = subprocess.run(command, capture_output=True, text=True, timeout=6000, check=True).stdout
    assert re.search(r'id="nearest">closest: [^<]+<b>[−\d.]+ m</b>', shown)
    assert re.search(r'id="fault" hidden', shown)
    assert "forearm" in shown and shown.count("<option value=") >= 3
