"""What numbers of real arms can be: beyond these, a description is asked about, warned of, or refused."""

import math

# Units. Joint limits are largest ones of joints that turn and of joints that slide, beyond those of all known
# arms (±400°, legs of 52 rad/s), with the unit that larger ones may be in, and its factor.
TURN = 2.02 * math.pi  # [rad] usual limit of a joint or an angle, rounded up; more may be degrees
LIMITS = {
    "position": ((4 * math.pi, "degrees", math.pi / 180), (30.0, "millimetres", 1e-3)),
    "velocity": ((60.0, "degrees per second", math.pi / 180), (10.0, "millimetres per second", 1e-3)),
    "effort": ((1e6, "mN·m", 1e-3), (1e7, "mN", 1e-3)),  # excavators have a half
}
ENDLESS = 500.0  # times the largest limit, from which on one is a placeholder, as powers of ten are
ROUND_NUMBER = 2e-3  # relative tolerance of such powers, as of 999
FASTEST_TIP, FAST_JOINT = 12.0, 15.0  # [m/s] of the tip at half of the limits above that [rad/s]: the motors'
LONGEST_ARM = 100.0  # [m] of all links together, beyond which they must be in millimetres
HEAVIEST_ARM, DENSEST_ARM = 50.0, 1000.0  # [kg], and [kg/m³] over its reach cubed: known arms have up to 540
GYRATION, GYRATION_REACHES = 6.0, 3.0  # [m] and in reaches: an impossible radius of gyration
INERTIA_UNITS = {"kg·mm²": 1e-6, "kg·cm²": 1e-4, "g·mm²": 1e-9}  # in kg·m²

# Doubtful links. Largest radius of gyration in sizes of a link, of at least a share of the reach: with a
# shape, and without one, where only its joints tell the size.
GYRATION_SHAPED, GYRATION_UNSEEN, SHORTEST_LINK = 1.4, 3.0, 0.25
LIGHT_LINK, FOAM = 2.5e-3, 25.0  # share of the median mass, and [kg/m³] over its size cubed
NEXT_TO_NOTHING = 1e-5  # of the heaviest link's mass, below which a mass is implausible
FARTHEST_CENTRE = 10.0  # mean distances between joints, from a joint to the centre of mass
PLACEHOLDERS = 3  # equal links that are no coincidence
CENTRED = 1e-3  # largest distance of a placeholder's centre of mass from its joint, in those mean distances
ALIKE_LINKS = 1e-6  # relative tolerance of equal masses and inertias

# Shapes: arm lengths across, and [m], above which they must be in millimetres, or below which scaled twice.
LARGE_SHAPE, LARGE_BASE, LARGE_AT_LEAST, SMALL_MESH = 5.0, 50.0, 3.0, 0.002
FALSE_COLLISIONS = 0.01  # of the configurations in which hulls of two links may collide falsely

UPRIGHT = 0.7  # cosine of the largest tilt of a base that stands, or of a plane that is a floor
WIDER_LIMIT = 1e-3  # relative tolerance of limits wider than the description's
