"""The closest pair and its nearest points are those that coal finds."""

import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.robot import capsule_geometry, chain_model
from sidegan.validity import Box, Constraints, Plane
from sidegan.validity.closest import closest


def positions(arm, count):
    draw = torch.rand(count, arm.joints, dtype=torch.float64, generator=torch.Generator().manual_seed(0))
    return torch.lerp(arm.position_lower, arm.position_upper, draw)


def test_the_closest_pair_and_its_points_are_coals(arm):
    constraints, q = Constraints(arm), positions(arm, 60)
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


def test_points_at_regions_lie_on_their_surfaces(planar):
    box = Box((0.5, -0.1, 0.0), (0.9, 0.1, 0.3))
    constraints = Constraints(planar, [Plane((0.0, 0.0, 1.0), -0.2), box])
    found = closest(constraints, positions(planar, 400))
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
    assert closest(alone, positions(planar, 3)) is None
