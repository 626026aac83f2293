"""The closest pair and its nearest points are those that coal finds."""

import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.robot import capsule_geometry, chain_model, load_robot
from sidegan.validity import Box, Constraints, Plane
from sidegan.validity.closest import closest
from tests.chains import random_states
from tests.robot.urdf import INERTIA, collision, joint, link, robot


def test_the_closest_pair_and_its_points_are_coals(arm):
    constraints, q = Constraints(arm), random_states(arm, 60)[0]
    found = closest(constraints, q)
    model, geometry = chain_model(arm), capsule_geometry(arm)
    for i, j in constraints.pairs.tolist():
        geometry.addCollisionPair(pin.CollisionPair(i, j))
    data, shapes = model.createData(), geometry.createData()
    apart = 0
    for k, position in enumerate(q.numpy()):
        pin.computeDistances(model, data, geometry, shapes, position)
        results = list(shapes.distanceResults)
        nearest = min(range(len(results)), key=lambda p: results[p].min_distance)
        assert float(found.distance[k]) == pytest.approx(results[nearest].min_distance, abs=1e-6)
        if results[nearest].min_distance < 0.01:
            continue  # coal's points of what overlaps are others
        apart += 1
        names = constraints.labels["collision"]
        assert found.names[int(found.which[k])] == names[nearest]
        theirs = results[nearest].getNearestPoint1(), results[nearest].getNearestPoint2()
        ours = found.points[k].numpy()
        assert np.linalg.norm(ours[0] - ours[1]) == pytest.approx(float(found.distance[k]), abs=1e-9)
        between = np.linalg.norm(np.subtract(*theirs)) - np.linalg.norm(np.subtract(*ours))
        assert between == pytest.approx(0, abs=1e-5)
    assert apart > 20


def test_points_of_pieces_are_coals_own(tmp_path, monkeypatch):
    """Two plates that turn about axes askew: capsules around them touch long before they do."""
    monkeypatch.setenv("SIDEGAN_CACHE", str(tmp_path))
    box = collision('<box size="0.5 0.4 0.02"/>'), collision('<box size="0.3 0.01 0.2"/>', 'xyz="0 0.1 0.2"')
    first = joint("j0", "l0", "l1", origin='xyz="0 0 0.15"', axis='<axis xyz="1 0.3 0"/>')
    second = joint("j1", "l1", "l2", origin='xyz="0.05 0 0.1"', axis='<axis xyz="0 1 1"/>')
    links = link("l0", box[0]), link("l1"), link("l2", INERTIA + box[1])
    file = tmp_path / "plates.urdf"
    file.write_text(robot(*links, first, second))
    arm = load_robot(file)
    constraints, q = Constraints(arm), random_states(arm, 200)[0]
    assert bool(constraints.pieces.finer.all())
    found = closest(constraints, q)
    whole = pin.buildModelFromUrdf(str(file))
    geometry = pin.buildGeomFromUrdf(whole, str(file), pin.GeometryType.COLLISION)
    geometry.addCollisionPair(pin.CollisionPair(0, 1))
    data, shapes = whole.createData(), geometry.createData()
    apart = 0
    for k, position in enumerate(q.numpy()):
        pin.computeDistances(whole, data, geometry, shapes, position)
        theirs = shapes.distanceResults[0].min_distance
        if theirs < 1e-3:
            continue
        apart += 1
        one, other = found.points[k].numpy()
        assert np.linalg.norm(one - other) == pytest.approx(theirs, abs=1e-6)
        assert float(found.distance[k]) == pytest.approx(theirs, abs=1e-6)
        for point, body in ((one, 0), (other, 1)):
            local = shapes.oMg[body].actInv(point)
            half = np.array([[0.25, 0.2, 0.01], [0.15, 0.005, 0.1]][body])
            assert (np.abs(local) <= half + 1e-9).all() and np.isclose(np.abs(local), half).any()
    assert apart > 60


def test_points_at_regions_lie_on_their_surfaces(planar):
    box = Box((0.5, -0.1, 0.0), (0.9, 0.1, 0.3))
    constraints = Constraints(planar, [Plane((0.0, 0.0, 1.0), -0.2), box])
    found = closest(constraints, random_states(planar, 400)[0])
    ours = {name: found.which == k for k, name in enumerate(found.names)}
    desk = ours["forearm in region 0"]
    assert desk.sum() > 5
    torch.testing.assert_close(found.points[desk][:, 1, 2], torch.full_like(found.distance[desk], -0.2))
    boxed = ours["forearm in region 1"] & (found.distance > 0)
    assert boxed.sum() > 20
    lower, upper = torch.tensor(box.lower), torch.tensor(box.upper)
    touched = found.points[boxed][:, 1]
    torch.testing.assert_close(touched, touched.clamp(lower, upper), atol=1e-6, rtol=0)
    gap = (found.points[boxed][:, 0] - touched).norm(dim=1)
    torch.testing.assert_close(gap, found.distance[boxed], atol=1e-9, rtol=0)


def test_nothing_is_closest_where_nothing_is_checked(planar):
    alone = Constraints(planar)
    alone.labels.pop("collision")
    assert closest(alone, random_states(planar, 3)[0]) is None
