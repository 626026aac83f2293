"""Moves from rest to rest."""

import pytest
import torch

from sidegan.errors import ShapeError
from sidegan.motion.moves import pick_and_place

LIMIT = torch.tensor([1.0, 2.0], dtype=torch.float64)
POINTS = torch.tensor([[0.0, 0.0], [1.0, 0.5], [0.9, -1.5]], dtype=torch.float64)
RATE, REST = 1000.0, 0.25


@pytest.fixture(scope="module")
def motion():
    return pick_and_place(POINTS, LIMIT, REST, RATE)


def test_the_arm_rests_in_every_waypoint(motion):
    still = (motion.velocity[0] == 0).all(1) & (motion.acceleration[0] == 0).all(1)
    for point in POINTS:
        there = (motion.position[0] - point).abs().amax(1) < 1e-12
        assert int((there & still).sum()) >= round(REST * RATE)
    assert int(still.sum()) < len(still) / 2


def test_the_joint_that_takes_longest_reaches_its_limit_and_none_exceeds_it(motion):
    share = (motion.velocity[0].abs() / LIMIT).amax(0)
    assert (share <= 1 + 1e-12).all()
    assert share.tolist() == pytest.approx([1.0, 1.0], abs=2e-3)  # each in one of the moves


def test_velocity_and_acceleration_are_derivatives(motion):
    step = 1 / RATE
    for x, slope in ((motion.position[0], motion.velocity[0]), (motion.velocity[0], motion.acceleration[0])):
        central = (x[2:] - x[:-2]) / (2 * step)
        scale = float(slope.abs().max())
        assert float((central - slope[1:-1]).abs().max()) < 0.01 * scale


def test_time_goes_by_the_rate(motion):
    assert float(motion.time[0]) == 0
    assert torch.allclose(motion.time.diff(), torch.tensor(1 / RATE, dtype=torch.float64))
    assert motion.position.shape == (1, len(motion.time), 2)


def test_a_waypoint_twice_is_a_longer_rest():
    twice = POINTS[[0, 1, 1]]
    motion = pick_and_place(twice, LIMIT, REST, RATE)
    assert motion.velocity.isfinite().all() and motion.acceleration.isfinite().all()


@pytest.mark.parametrize("points", [POINTS[:1], POINTS[:, :1], POINTS[0]])
def test_what_is_no_way_is_refused(points):
    with pytest.raises(ShapeError, match="waypoints are"):
        pick_and_place(points, LIMIT, REST, RATE)
