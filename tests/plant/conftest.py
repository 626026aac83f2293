import numpy as np

from sidegan.motion.trajectory import Trajectory


def motions(arm, count=1, period=4.0, rate=1000.0):
    """Lively random motions (count, T, J) of an arm."""
    home = ((arm.position_lower + arm.position_upper) / 2).tolist()
    trajectory = Trajectory(arm.joints, 3, period, home)
    c = np.random.default_rng(0).standard_normal((count, arm.joints, 3, 2))
    return trajectory.roll_out(0.1 * arm.velocity_limit[:, None, None] * c, trajectory.times(rate))
