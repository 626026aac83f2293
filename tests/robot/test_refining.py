"""Links are cut further where their hulls are in the way, and nowhere else."""

from collections import Counter
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import trimesh

from sidegan.robot import Setup, covers, load_robot
from sidegan.robot.capsule_fit import hull_volume
from sidegan.robot.refining import Refining
from sidegan.robot.splitting import cut_further, split
from sidegan.validity import Constraints
from sidegan.validity.accuracy import shape_accuracy

from .test_shapes import collision
from .urdf import INERTIA, joint, link, robot


@pytest.fixture
def ring_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """A rod that turns inside of a ring, far from its wall."""
    monkeypatch.setenv(covers.VARIABLE, str(tmp_path / "cache"))
    trimesh.creation.annulus(0.10, 0.12, 0.1, sections=24).export(tmp_path / "ring.stl")
    trimesh.creation.box((0.03, 0.03, 0.4)).export(tmp_path / "rod.stl")
    file = tmp_path / "robot.urdf"
    file.write_text(
        robot(
            link("base", collision('<mesh filename="ring.stl"/>')),
            joint("first", "base", "lower", origin='xyz="0 0 0"'),
            link("lower"),
            joint("second", "lower", "upper", origin='xyz="0.02 0 0"'),
            link("upper", INERTIA + collision('<mesh filename="rod.stl"/>')),
        )
    )
    return file


def pieces_of(arm, owner: str) -> int:
    return arm.capsules.owners.count(owner)


def test_a_ring_around_a_rod_is_cut_until_the_rod_is_free(ring_file):
    coarse = load_robot(ring_file, Setup(pieces=2, finer=2, may_touch=[("base", "upper")]))
    assert pieces_of(coarse, "base") <= 2
    fine = load_robot(ring_file, Setup(pieces=2))
    assert pieces_of(fine, "base") > 2
    assert pieces_of(fine, "upper") == 1
    assert shape_accuracy(fine, 300) == (0.0, 0.0)
    assert Constraints(fine).described()


def test_what_was_found_is_kept(ring_file, monkeypatch):
    fine = load_robot(ring_file, Setup(pieces=2))
    monkeypatch.setattr("sidegan.robot.refining._Scene", None)  # nothing is looked for again
    again = load_robot(ring_file, Setup(pieces=2))
    assert again.digest == fine.digest
    assert again.capsules.owners == fine.capsules.owners


def test_other_pieces_are_another_arm(ring_file):
    setups = [Setup(pieces=2), Setup(pieces=2, finer=4), Setup(pieces=1)]
    assert len({load_robot(ring_file, setup).digest for setup in setups}) == 3


class Blaming:
    """A scene of few configurations, most of whose refusals one link is to blame for, and one another."""

    pairs = 10**9

    def __init__(self, *_) -> None:
        pass

    def refused(self, q):
        return list(range(20)) if len(q) > 20 else [], len(q)

    def blamed(self, q, rows):
        return Counter(often=19, once=1)


def test_a_link_that_is_in_the_way_once_is_not_cut_further(monkeypatch):
    monkeypatch.setattr("sidegan.robot.refining._Scene", Blaming)
    monkeypatch.setattr("sidegan.robot.refining.shapes_of", lambda *_: [])
    model = SimpleNamespace(names=["universe", "turn"])
    description = SimpleNamespace(limits={"turn": SimpleNamespace(lower=-1.0, upper=1.0)})
    shapes = [SimpleNamespace(owner=name, digest=name) for name in ("often", "once")]
    assert Refining(model, None, description, pieces=2, most=8)._search(shapes) == {"often": 4}


def test_a_plane_divides_triangles_and_leaves_nothing_out():
    random = np.random.default_rng(0)
    triangles, normal = random.normal(size=(200, 3, 3)), np.array([1.0, 2.0, 2.0]) / 3
    triangles[:20] -= ((triangles[:20] @ normal - 0.1)[:, :1, None]) * normal  # a corner in the plane
    below, above = split(triangles, normal, 0.1)
    assert (below @ normal).max() <= 0.1 + 1e-12 and (above @ normal).min() >= 0.1 - 1e-12

    def area(some):
        return np.linalg.norm(np.cross(some[:, 1] - some[:, 0], some[:, 2] - some[:, 0]), axis=1).sum()

    assert area(below) + area(above) == pytest.approx(area(triangles), rel=1e-12)


def test_cuts_leave_out_what_is_empty():
    """Of a tube's hull two thirds are empty: sixteen parts leave out nearly all of that."""
    tube = trimesh.creation.annulus(0.08, 0.1, 0.2, sections=48)
    parts = cut_further([np.asarray(tube.triangles)], 16)
    assert 4 <= len(parts) <= 16
    assert sum(hull_volume(part.reshape(-1, 3)) for part in parts) < 1.2 * tube.volume
    (box,) = cut_further([np.asarray(trimesh.creation.box((1, 2, 3)).triangles)], 16)
    assert len(box) == 12
