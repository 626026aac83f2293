"""What decides whether limits and shapes of an arm are plausible, and where it can stand and rest."""

import math

# Torque limits, against what holds the arm in random configurations.
GEARED = 5.0  # least ratio of a holding torque and a limit that may be the motor's
COINCIDENCE = 3  # joints of which the same limit is no coincidence
MOSTLY_HELD = 0.95  # share of these configurations in which sufficient limits hold the arm
SPARE_TORQUE = 20.0  # largest plausible ratio of the weakest joint's limit to the largest holding torque
PLAUSIBLE_TORQUE = 100.0  # [N·m] always plausible for the weakest joint
PLAUSIBLE_UNKNOWN = 1000.0  # [N·m] the same without masses

# Velocity limits are probably the motors' if half of the turning joints exceed [rad/s], and one alone
# moves the tip faster than [m/s].
FAST_JOINT, FASTEST_TIP = 15.0, 12.0
LEG_JOINTS = 3  # an arm of no more may be a leg, whose tip is as fast as an arm's with the motors' velocities

# Share of the limits to use by default: leaves room for feed-forward errors of a quarter.
CAREFUL_EFFORT = 0.8
CAREFULLY_HELD = 0.95  # least share of configurations in which the arm can hold itself with that

# Home and floor.
HOME_TURN = 2.1 * math.pi  # [rad] from zero, up to which a home is no angle in degrees, whatever the limits
STANDING_SHARE = 0.02  # least share of random configurations above the floor of an arm that stands on it

# Shapes.
DISPLACED = 0.2  # arm lengths; shapes of neighbours come closer
MOSTLY_TOUCHING = 2 / 3  # share of configurations above which links that touch are warned of
SHORT_ARM_PAIRS = 3  # up to so many pairs, all may always touch
