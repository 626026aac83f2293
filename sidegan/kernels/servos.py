"""Compiled time steps of plants: servos against friction, and the hysteresis of torque sensors."""

from typing import NamedTuple

from sidegan.base.arrays import Array
from sidegan.kernels import friction as _friction
from sidegan.kernels.friction import Law, friction_torque
from sidegan.kernels.jit import inline_functions, kernel

inline_functions(_friction)


class Servos(NamedTuple):
    """References of B motions, (B, T, J), and servos, (J,)."""

    position: Array  # [rad or m]
    velocity: Array
    ahead: Array  # torques that are fed forward [N·m or N]
    stiffness: Array  # [N·m/rad]
    damping: Array  # [N·m·s/rad]
    limit: Array  # of the torques [N·m or N]


@kernel
def drive(
    i: int, servos: Servos, law: Law, bearings: Law, q: Array, dq: Array, load: Array, torques: Array
) -> None:
    """Write torques of motors, behind their friction, and on the links, (3, B, J), in time step i.

    States and loads, the torques behind the gears in the step before, are (B, J).
    """
    for b in range(len(q)):
        for j in range(q.shape[1]):
            servo = servos.stiffness[j] * (servos.position[b, i, j] - q[b, j])
            servo += servos.damping[j] * (servos.velocity[b, i, j] - dq[b, j])
            limit = servos.limit[j]
            motor = min(max(servos.ahead[b, i, j] + servo, -limit), limit)
            driven = motor - friction_torque(q[b, j], dq[b, j], load[b, j], law, j)
            torques[0, b, j] = motor
            torques[1, b, j] = driven
            torques[2, b, j] = driven - friction_torque(q[b, j], dq[b, j], 0.0, bearings, j)


@kernel
def slipped(load: Array, bounds: Array, held: Array) -> None:
    """Write the sum of stops, which follow a load (B, T, J) from zero up to bounds (R, J), and slip there."""
    for b in range(len(load)):
        for j in range(load.shape[2]):
            for r in range(len(bounds)):
                before, stop = 0.0, 0.0
                for t in range(load.shape[1]):
                    stop = min(max(stop + (load[b, t, j] - before), -bounds[r, j]), bounds[r, j])
                    before = load[b, t, j]
                    held[b, t, j] += stop
