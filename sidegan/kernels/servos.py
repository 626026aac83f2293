"""Servos and friction of an arm that somebody else's simulator moves, compiled.

The simulator is a function of two pointers that advances a state by one step, such as MuJoCo's ``mj_step``.
"""

import math
from typing import Any, NamedTuple

from llvmlite import ir
from numba import types
from numba.extending import intrinsic

from sidegan.kernels.chain import Array
from sidegan.kernels.jit import inline, kernel

LINEAR, EYRING, TUSTIN = range(3)  # forms of friction
_FINE = 1e-6  # [rad/s] that keeps powers of the speed finite at rest


class Friction(NamedTuple):
    """A law of ``plant.friction``; arrays are (J,)."""

    form: int
    width: float
    stribeck: float
    load: float
    asymmetry: float
    position: float
    ripple: float
    scale: Array
    coulomb: Array
    viscous: Array
    speed: Array
    phase: Array  # (3, J)
    skew: Array


class Servos(NamedTuple):
    """Servos, whose motors turn rotors behind the friction; arrays are (J,)."""

    stiffness: Array
    damping: Array
    limit: Array  # of the motors' torques
    rotor: Array
    rate: float  # of the steps [Hz]


class Simulator(NamedTuple):
    """A step, what it is called with, and where it keeps its state."""

    step: int  # address of the function
    model: int  # address
    data: int  # address
    position: Array  # (J,), as all that follow
    velocity: Array
    applied: Array  # torques


@intrinsic
def _call(typing: Any, function: Any, first: Any, second: Any) -> Any:
    """Call a function of two pointers that returns nothing, by its address."""

    def generate(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        word = ir.IntType(64)
        kind = ir.FunctionType(ir.VoidType(), [word, word])
        builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), [arguments[1], arguments[2]])
        return context.get_dummy_value()

    return types.void(types.int64, types.int64, types.int64), generate


@inline
def friction_of(law: Friction, j: int, q: float, dq: float, load: float) -> float:
    """Friction of a joint; see ``plant.friction.Law``."""
    s = math.tanh(dq / law.width)
    coulomb, viscous, scale = law.coulomb[j], law.viscous[j], law.scale[j]
    if law.form == LINEAR:
        return coulomb * s + viscous * dq
    speed, size = law.speed[j], abs(load)
    if law.form == EYRING:
        near = dq / speed
        rest, thin = 1 / (1 + near * near), 6 * speed
        lubricant = thin * math.asinh(dq / thin)
        loaded = load * load / (size + 0.5 * scale) * (1 + 0.3 * s * math.tanh(load / scale))
        place = 0.6 * math.cos(q + law.phase[0, j]) + 0.4 * math.cos(3 * q + law.phase[1, j])
        wave = math.sin(54 * q + law.phase[2, j]) * (1 + 0.5 * load / scale)
    else:
        fast = abs(dq) + _FINE
        rest = math.exp(-math.sqrt(fast / speed))
        lubricant = math.copysign((6 * speed * fast * fast) ** (1 / 3), dq) if dq != 0 else 0.0
        loaded = size * math.sqrt(size) / math.sqrt(scale)
        one = math.sin(q + law.phase[0, j])
        place = one * abs(one)
        wave = math.tanh(3 * math.sin(81 * q + law.phase[1, j]))
    level = 1 + law.stribeck * rest + law.asymmetry * law.skew[j] * s + law.position * place
    return s * (coulomb * level + law.load * loaded) + viscous * lubricant + law.ripple * scale * wave


@kernel
def follow(simulator: Simulator, servos: Servos, law: Friction, wanted: Array, out: Array) -> None:
    """Follow one motion from where the simulator's state is.

    Args:
        simulator: what moves the arm.
        servos: what drives it.
        law: friction.
        wanted: position, velocity and the torque that the controller expects, (3, T, J); the velocities are
            overwritten by those that were reached.
        out: takes position, the motors' torque and friction, (3, T, J).
    """
    joints = wanted.shape[2]
    for i in range(wanted.shape[1]):
        for j in range(joints):
            q, dq = simulator.position[j], simulator.velocity[j]
            ahead = servos.stiffness[j] * (wanted[0, i, j] - q) + servos.damping[j] * (wanted[1, i, j] - dq)
            motor = min(max(wanted[2, i, j] + ahead, -servos.limit[j]), servos.limit[j])
            push, past = (simulator.applied[j], wanted[1, i - 1, j]) if i > 0 else (0.0, wanted[1, 0, j])
            load = push - servos.rotor[j] * (dq - past) * servos.rate
            friction = friction_of(law, j, q, dq, load)
            wanted[1, i, j] = dq  # the reference is no longer needed
            out[0, i, j], out[1, i, j], out[2, i, j] = q, motor, friction
            simulator.applied[j] = motor - friction
        _call(simulator.step, simulator.model, simulator.data)  # type: ignore[call-arg]  # numba gives the first
