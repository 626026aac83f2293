"""How far bodies get in a cell, by closed forms."""

import numpy as np
import pytest

from sidegan.kernels.cells import bend, least_height
from sidegan.kernels.distances import near_region
from sidegan.motion.arrays import kernel_shapes
from sidegan.validity import Box, Convex, Plane, Sphere
from sidegan.validity.regions import tables

REGIONS = {
    "plane": Plane((0.206284, -0.309426, 0.928279), 0.4),
    "box": Box((-0.4, -0.3, 0.2), (0.3, 0.4, 0.9)),
    "ball": Sphere((0.2, 0.1, 0.5), 0.3),
    "body": Convex.between((-0.3, -0.2, 0.3), (0.2, 0.3, 0.8), 0.2),
}
LENGTHS, SPEEDS, HALF = np.array([0.4, 0.3, 0.2]), np.array([1.5, 0.7, 2.0]), 0.01


@pytest.mark.parametrize("inner", [0, 1])
def test_the_bound_on_deviation_from_even_motion_is_reached(inner):
    """Joints with parallel axes at constant speeds: each link pulls the tip inwards by length · turning²."""
    reach = np.stack([0 * LENGTHS, LENGTHS[::-1].cumsum()[::-1]])
    motion = np.stack([0 * SPEEDS, 0 * SPEEDS, SPEEDS, 0 * SPEEDS])
    pull = LENGTHS[inner:] @ SPEEDS[inner:].cumsum() ** 2
    assert bend(reach, 1, (inner, 3), motion, HALF) == pytest.approx(HALF**2 / 2 * pull)
    motion[3] = 5.0, 3.0, 2.0  # all of these accelerations at once, in the worst direction
    pull += reach[1, inner:] @ motion[3, inner:]
    assert bend(reach, 1, (inner, 3), motion, HALF) == pytest.approx(HALF**2 / 2 * pull)


@pytest.mark.parametrize("name", REGIONS)
def test_an_evenly_moving_capsule_keeps_its_distance_bound(planar, name):
    """To a plane just as near: there one of the ends is the nearest point, at one of the cell's ends."""
    region, none = REGIONS[name], np.zeros((0, 2), dtype=int)
    shapes = kernel_shapes(planar.capsules, none, none, tables([region]))
    random, half, radius = np.random.default_rng(0), 0.2, shapes.radius[0]
    for _ in range(60):
        ends, twist = random.normal(size=(3, len(shapes.radius), 3)), random.normal(size=(2, 3, 3))
        turning, moving = twist[:, shapes.frame[0]]
        speeds = moving + np.cross(turning, ends[:2, 0])
        at = [ends[:2, 0] + t * speeds for t in (0.0, *np.linspace(-half, half, 9))]
        contacts = [near_region(shapes, 0, tuple(a), tuple(b)) for a, b in at]
        now, *cell = (distance - radius for distance, _, _ in contacts)
        if now > 0:
            found = least_height(shapes, ends, twist, 0, contacts[0], half)
            assert found <= min(cell) + 1e-7
            if name == "plane":
                assert found == pytest.approx(min(cell))
