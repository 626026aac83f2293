"""What numbers of real arms can be: beyond these, a description is asked about, warned of, or refused."""

import math
from typing import NamedTuple


class Largest(NamedTuple):
    """The largest plausible limit of a joint in SI units, the likely unit of a larger one, and its factor."""

    value: float
    unit: str
    factor: float


# By kind, for joints that turn and for joints that slide. Known arms reach ±400°, and legs 52 rad/s.
LIMITS = {
    "position": (
        Largest(4 * math.pi, "degrees", math.pi / 180),
        Largest(30.0, "millimetres", 1e-3),
    ),
    "velocity": (
        Largest(60.0, "degrees per second", math.pi / 180),
        Largest(10.0, "millimetres per second", 1e-3),
    ),
    "effort": (Largest(1e6, "mN·m", 1e-3), Largest(1e7, "mN", 1e-3)),  # excavators have half of it
}
FULL_TURN = 2.02 * math.pi  # [rad] usual limit of a joint or an angle, rounded up; more may be degrees
ENDLESS = 500.0  # a limit more than this many times the largest plausible one is a placeholder
ROUND_NUMBER = 2e-3  # tolerance of placeholders: relative to powers of ten (999), or in half turns
LONGEST_ARM = 100.0  # [m] of all links together, beyond which they must be in millimetres
# An arm heavier than both of [kg] and [kg/m³] over its reach cubed is in grams: known arms reach 540 kg/m³.
HEAVIEST_ARM, DENSEST_ARM = 50.0, 1000.0
# A radius of gyration above both of [m] and [reaches] is impossible: inertias must be in another unit.
GYRATION, GYRATION_PER_REACH = 6.0, 3.0
INERTIA_UNITS = {"kg·mm²": 1e-6, "kg·cm²": 1e-4, "g·mm²": 1e-9}  # in kg·m²

# Doubtful links.
GYRATION_SHAPED = 1.4  # [sizes of a link] largest radius of gyration of one with a shape
GYRATION_UNSEEN = 3.0  # the same of one without, whose joints alone tell the size
SHORTEST_LINK = 0.25  # [reaches] least size of a link that its radius of gyration is compared with
# A link lighter than both of a share of the median mass and [kg/m³] over its size cubed is doubtful.
LIGHT_LINK, DENSITY_OF_FOAM = 2.5e-3, 25.0
NEXT_TO_NOTHING = 1e-5  # of the heaviest link's mass, below which a mass is implausible
FARTHEST_CENTRE = 10.0  # [mean distances between joints] from a joint to the centre of mass
# Equal links whose centres of mass are at their joints are placeholders if they are most links, and so many.
PLACEHOLDERS = 3
CENTRED = 1e-3  # [mean distances between joints] largest distance of such a centre of mass
ALIKE_LINKS = 1e-6  # relative tolerance of equal masses and inertias

# Sizes of shapes, by which those in other units are told.
LARGE_SHAPE = 5.0  # [arm lengths] of a moving link's shape that must be in millimetres
LARGE_BASE = 50.0  # [arm lengths] the same of a fixed mesh, which may be a room
LARGE_AT_LEAST = 3.0  # [m] smaller shapes are never too large
SMALL_MESH = 0.002  # [arm lengths] a smaller mesh of a moving link was scaled from millimetres twice
FALSE_COLLISIONS = 0.01  # share of random configurations in which hulls of two links may touch falsely

UPRIGHT = 0.7  # cosine of the largest tilt of a base that stands, or of a plane that is a floor
WIDER_BY = 1e-3  # relative tolerance of limits wider than the description's
