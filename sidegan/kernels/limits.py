"""What motions cost that come near their limits."""

from typing import NamedTuple

from sidegan.kernels.chain import Array


class Limits(NamedTuple):
    """Limits of J joints.

    A position, a velocity or a torque costs weight times the square of how far it exceeds the limit less
    the reserve, as a share of the limit.
    """

    weight: float  # of positions, velocities and higher derivatives
    reserve: float  # share of their limits that is kept free
    torque_weight: float
    torque_reserve: float
    middle: Array  # of the positions [rad or m], (J,)
    room: Array  # to both sides of it [rad or m], (J,)
    speed: Array  # largest [rad/s or m/s], (J,)
    torque: Array  # largest [N·m or N], (J,); infinite where it does not matter
    parameters: Array  # that torques follow from, (10 J,)
