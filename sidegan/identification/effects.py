"""Effects on the torque of single joints, beyond rigid bodies and usual friction: kinds, forms, columns."""

from collections.abc import Sequence
from typing import Literal, NamedTuple, TypeAlias

import numpy as np

from sidegan.base.arrays import Array

_REST = (0.1, 0.3)  # widths of friction near rest, of a Gaussian and of an exponential [rad/s]
_ROOTED = 1e-2  # velocity below which the square root becomes linear [rad/s]

# As in settings: near_rest is Stribeck's, load is friction in gears, position a spring or a cable.
KindName: TypeAlias = Literal[
    "near_rest", "load", "nonlinear_viscous", "direction", "position_friction", "position", "ripple"
]


class Kind(NamedTuple):
    """A kind of effect: a sum of forms, each with a parameter."""

    words: str  # for reports
    letters: tuple[str, ...]  # of the parameters' names


EFFECT_KINDS: dict[str, Kind] = {
    "near_rest": Kind("friction near rest", ("sa", "sb")),
    "load": Kind("friction that grows with the load", ("fl",)),
    "nonlinear_viscous": Kind("nonlinear viscous friction", ("fr",)),
    "direction": Kind("friction that differs between directions", ("fd",)),
    "position_friction": Kind("friction that depends on the position", ("pa", "pb")),
    "position": Kind("torque that depends on the position", ("ka", "kb", "kc", "kd")),
    "ripple": Kind("ripple", ("wa", "wb", "wc", "wd")),
}
_ENDS = np.cumsum([len(kind.letters) for kind in EFFECT_KINDS.values()]).tolist()
PLACES = {name: range(end - len(kind.letters), end) for (name, kind), end in zip(EFFECT_KINDS.items(), _ENDS)}


def forms(q: Array, dq: Array, sign: Array, load: Array) -> Array:
    """Torques of a unit of each form, in the order of ``PLACES``, (K, …).

    At positions, velocities, smooth signs of the velocities, and loads relative to usual ones.
    """
    slow, slower = _REST
    size = np.abs(load)
    waves = [wave(n * q) for n in (2, 8, 20, 100) for wave in (np.sin, np.cos)]
    friction = [sign * np.exp(-np.square(dq / slow)), sign * np.exp(-np.abs(dq) / slower)]
    friction += [sign * size, sign * np.sqrt(np.hypot(dq, _ROOTED)), np.abs(dq)]
    return np.stack([*friction, sign * np.sin(2 * q), sign * np.cos(2 * q), *waves])


class Effects(NamedTuple):
    """Effects that are terms of a model; their columns come last.

    The load is the torque of parameters of links and rotors that are known beforehand, so that the model
    stays linear in its own.
    """

    chosen: Sequence[tuple[int, str]]  # joint and kind, of ``EFFECT_KINDS``
    load: Array  # values of the first of the model's P parameters
    usual: Array  # usual load [N·m or N], (J,)

    @property
    def columns(self) -> list[tuple[int, int]]:
        """Joint and form of each column."""
        return [(j, form) for j, kind in self.chosen for form in PLACES[kind]]

    @property
    def names(self) -> list[str]:
        """Names of the parameters, such as "fl2"."""
        return [f"{letter}{j + 1}" for j, kind in self.chosen for letter in EFFECT_KINDS[kind].letters]
