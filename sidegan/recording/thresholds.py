"""Numbers that decide whether a recording is refused, corrected or warned about.

docs/identify.md lists those that users meet. Deviations are in standard deviations σ of the quantity in
question, shares in the unit of what they are of.
"""

import math

# What a file's rows and columns are taken for.
LARGEST_VALUE = 1e12  # in SI units: no sensor measures more, so that the row is damaged
LATEST_STAMP = 1e21  # the same of time stamps, if most are above ``LARGEST_VALUE``, as nanoseconds since 1970
MOST_CORRUPT = 0.5  # share of a file's rows: with more, its columns are not what they are taken for
BLANK_CELLS = 0.1  # share of rows without a signal, from which it was logged on rows of its own
MOST_GRIPPER_COLUMNS = 2  # after the arm's last joint; more belong to another arm
WIDEST_STACK = 50  # columns of a stack of joints' signals; wider ones are images
MOST_DATES = 0.5  # share of dates among the texts of a column, from which it holds dates
SINCE_1970 = 9.4e8, 4.1e9  # [s] plausible range of such clocks: 2000 to 2100

# The clock.
LEAST_SAMPLES = 10  # of a recording
LEAST_MOTION = 16  # samples of the motion, at 50 Hz or less, that show its bandwidth
LEAST_PERIODS = 4.0  # of the cut-off in a recording: the length of the filter's edges
LEAST_HELD_OUT = 20  # preprocessed samples in each part of a recording that is split
LONGEST_STEP = 0.5  # [s] between samples: nobody logs an arm's motion more slowly
USUAL_STEP = 0.15  # [s] between samples, to which the unit of a clock that is too slow is corrected
RESTARTS = 0.01  # share of backward steps, below which the clock restarted and rows are in order
MOST_JITTER = 0.5  # deviation of the time between samples, relative to its mean
GAP_STEPS = 5.0  # sampling steps that are interpolated over
GAP_PERIODS = 0.25  # periods of the cut-off that are interpolated over: the low-pass hides the error

# Positions: units and jumps.
MOVED = 0.02  # [rad or m] range of a joint's positions below which it stands still, but for its encoder
FAR_ANGLE = 1.5  # times a joint limit, from which angles are hardly in radians
ANY_ANGLE = 2.1 * math.pi  # [rad] a turn: plausible whatever the limits
LEAST_ANGLE = math.pi**2 / 90  # [rad] a turn in radians, read as degrees: all smaller ones are in radians
FAR_LENGTH = 5.0  # times a prismatic joint's limit, from which lengths are hardly in metres
USED_LENGTH = 0.1  # share of its range through which a prismatic joint in use moves at least
FAR_COUNTS = 10.0  # times a joint limit, from which positions are hardly in any unit of angle
LARGEST_ROTATION = math.pi / 2  # [rad] between two samples, beside whole turns
OTHER_JUMPS = 1e-3  # share of larger rotations up to which whole turns are removed
JUMP = 0.02  # [rad or m] between samples, up to which it is none
JUMP_STEPS = 5.0  # the same, times the usual largest steps, and times the joint's speed
GLITCH_QUANTILE, JUMP_QUANTILE = 0.95, 0.99  # of steps that is usual: of samples left out, and of refusals
JUMP_SAMPLES = 4  # after which a position that has not returned stays; and neighbours it is compared with
DRIVES_OFF = 0.5  # [s] of constant torques at rest, from which brakes hold the arm
HARDLY_MOVED = 0.1  # share of its range below which a joint hardly moves
BEYOND_LIMITS = 1e-3  # [rad or m] tolerance of position limits

# Recorded rates, compared with derivatives of what they are rates of.
LEAST_RATE = 0.1  # [rad/s or m/s], root mean square: ten times the width of the smooth sign of a velocity
RATE_RATIO = 1.1  # of a rate and the derivative, either way: differentiation is right to a few per cent
RATE_CORRELATION = 0.5  # of a rate with the derivative
OTHER_RATE = 0.95  # correlation of a rate with another joint's derivative, from which it is that joint's
DEGREES_RATIO = 0.3  # tolerance of a ratio's logarithm that is that of degrees and radians
RATE_LAG = 0.01  # [s] between a rate and the derivative: more is not a filter's

# Torques.
BEYOND_TORQUE_LIMIT = 3.0  # times the limit: more than drives stand for a hundredth of the time
BEYOND_DESCRIPTION = 30.0  # times the described torque: more than badly guessed masses explain
OUTLIERS = 1e-3  # share of samples: fewer beyond the usual filtered torque are damaged rows
COARSE_TORQUE = 0.02  # quantum of a signal as a share of its range
SATURATED = 5  # mean runs of equal samples at an extreme
PEAK = 0.2  # longest time one quantum from the extreme, as a share of such a run: a peak has 0.4 or more
FROZEN = 0.3  # share of its range through which a joint moves while its torque is constant
FROZEN_SAMPLES = 20  # fewer are coarse quantisation

# The delay of torques behind the motion.
LONGEST_DELAY = 1.0  # [s] that is searched
NOTABLE_DELAY = 0.02  # [s] from which there is a warning; a single fit is accurate up to it
LEAST_DELAY = 2e-3  # [s] that is worth removing: stiction looks like smaller ones
SAME_DELAY = 3e-3  # [s] between delays of one arm, part of which may be stiction
CERTAIN_DELAY = 3.0  # σ from zero
EXPLAINED_BY_DELAY = 0.5  # what a long delay leaves of the squared residual without one

# Torques and the description: shares of variance left, ratios and correlations, joint by joint.
CORRELATED, CLEARLY_CORRELATED = 0.4, 0.9  # with the described torque: a sign shows, and a scale
MOVED_FOR_SIGN = 0.1  # [rad or m] range of motion that shows a joint's sign
FEW_JOINTS = 3  # that must show their signs, or scales, for a convention of all
DISSIPATED = 0.02  # share of the power that friction takes if the torque is not reversed
OTHER_UNIT = 2.0  # ratio to the described torque, or its inverse: no masses are that wrong
SCALE_OF_LIMITS = 0.2  # tolerance of a scale's logarithm, for torques in per cent of each joint's limit
STRANGE_ARM = 4  # joints per agreeing joint from which the description hardly fits the arm
USUAL_TORQUE = 0.99  # quantile
OTHER_PACE = 1.3  # ratio of paces, or its inverse
OTHER_DIRECTION = 0.26  # [rad] 15° between gravities: smaller ones are errors of masses
NOTABLE_TILT = 0.03  # [rad] 2°, where links are fitted with the gravity: less is a mounting tolerance
EXPLAINED_BY_GRAVITY = 0.7  # what another gravity leaves of the described one's error
LEFT_BY_GRAVITY = 0.5  # what it leaves of the median joint's variance
EXPLAINED_BY_MAP = 0.3  # what other positions or columns, of which many are tried, leave of the error
LEFT_BY_MAP = 0.3  # what they leave of the variance, mean over joints
POOR = 0.15  # variance left, mean over joints, from which motors before gears are tried
EXPLAINED_BY_RATIOS = 0.4  # what a gear ratio for each joint leaves of it

# Recordings of the same run.
SAME_ROWS = 32  # consecutive common rows that are no coincidence
LIKE_PART = 0.05  # share of a part's variance that may differ before a filter is fitted
COPIED_NOISE = 0.4  # of the noise's variance that is left of a copy; of a repetition, more than all is left

# Commanded trajectories in a recording.
COMMANDED = 0.9  # correlation of recorded and commanded velocities
COMMANDED_PLACE = 0.1  # [rad or m] between mean commanded and recorded positions: servos are nearer

# Numerical guards.
NEGLIGIBLE = 1e-12  # of squares and norms in SI units: keeps quotients finite
# share of a described torque, below which what rotors and friction do not explain of it is rounding: a right
# angle written as 1.5708 tilts a joint by 4e-6
ROUNDING = 1e-5
LEAST_SCALE = 1e-300  # of numbers in any unit: weights of constant ones stay finite
