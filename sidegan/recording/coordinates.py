"""What recorded positions may be in place of the joints': in other units, of motors, swapped, coupled."""

import math
from collections.abc import Iterator
from itertools import combinations, permutations
from typing import NamedTuple

import numpy as np
import scipy  # submodules load lazily

from sidegan.base.arrays import Array
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.gravity import misfit
from sidegan.recording.units import Units
from sidegan.robot import Arm

BETTER = 0.3  # largest ratio of residuals, of other over recorded positions, at which others are believed
UNLIKE = 0.3  # most that they may leave unexplained then, mean over joints
_FEW = 500  # samples to compare positions by
_HALVES = 2_000  # samples, in two halves, in which the best are compared again
_POOR = 0.15  # mean unexplained share from which a factor is sought for each joint
_FACTORS = 0.4  # largest ratio of the mean unexplained shares, with over without factors
_FARTHEST = 1.5  # largest logarithm of a factor, from where the joints reach half of their limits
_SHARES = {"per cent of each joint's range (−100 to 100)": (-100, 100), "shares of it (−1 to 1)": (-1, 1)}
_SHARES |= {"per cent of each joint's range (0 to 100)": (0, 100), "shares of it (0 to 1)": (0, 1)}


class Map(NamedTuple):
    """The joints' positions as M q + z of recorded ones q, with what to say where they explain torques."""

    matrix: Array  # M, (J, J)
    zero: Array  # z [rad or m], (J,)
    text: str  # ends with the setting or change of the file that makes it so

    def of(self, q: Array, v: Array, a: Array) -> tuple[Array, Array, Array]:
        """Positions, velocities and accelerations, (S, J) each, of recorded ones."""
        return q @ self.matrix.T + self.zero, v @ self.matrix.T, a @ self.matrix.T


def _units(arm: Arm, units: Units) -> Iterator[Map]:
    """Maps from other units."""
    none = np.zeros(arm.joints)
    turn = np.where(arm.prismatic, 1.0, 2 * math.pi)
    lower, span = arm.position_lower, arm.position_upper - arm.position_lower
    rows = [("turns", turn, none)]
    rows += [(name, span / (b - a), lower - a * span / (b - a)) for name, (a, b) in _SHARES.items()]
    for name, factor, zero in rows:
        setting = units.setting(factor, zero, arm.prismatic)
        yield Map(np.diag(factor), zero, f"are the positions in {name}? they fit far better ({setting})")
    degrees = np.where(arm.prismatic, 1.0, math.pi / 180)
    yield Map(np.diag(degrees), none, "are these degrees? (recording.units.angle=deg)")


def _columns(arm: Arm) -> Iterator[Map]:
    """Maps from reversed, swapped and coupled joints."""
    names, none, own = arm.joint_names, np.zeros(arm.joints), np.eye(arm.joints)
    for j, name in enumerate(names):
        text = (
            f"the axis of {name} looks reversed: turned the other way, it explains the torques far better; "
            "negate its columns of position, velocity and torque, or its axis in the description"
        )
        yield Map(own - 2 * np.outer(own[j], own[j]), none, text)
    for j, k in combinations(range(arm.joints), 2):
        order = np.arange(arm.joints)
        order[[j, k]] = k, j
        text = (
            f"the motions of {names[j]} and {names[k]} look swapped: each one's torque fits the other's "
            "positions; is the order of columns right? (recording.position)"
        )
        yield Map(own[order], none, text)
    for j, k in permutations(range(arm.joints), 2):
        if abs(j - k) > 1:
            continue
        for sign, what in ((-1.0, "subtract the latter from"), (1.0, "add the latter to")):
            text = (
                f"the position of {names[j]} looks counted from that of {names[k]}, as from the horizontal: "
                f"{what} the former, in columns of position and velocity"
            )
            yield Map(own + sign * np.outer(own[j], own[k]), none, text)


def positions_behind(
    body: RigidBody, left: float, units: Units, q: Array, v: Array, a: Array, torque: Array
) -> Map | None:
    """The map with which the description explains torques far better, in both halves of samples (S, J).

    None if there is none. ``left`` is the mean unexplained share without a map, with the best gravity.
    """
    arm, joints = body.arm, body.joints
    *motion, measured = (x[:: max(1, len(q) // _FEW)] for x in (q, v, a, torque))
    same = Map(np.eye(joints), np.zeros(joints), "")

    def misfit_of(x: Map) -> float:
        return misfit(body, x.of(*motion), measured)

    best = min([same, *_units(arm, units), *_columns(arm)], key=misfit_of)
    if misfit_of(best) > joints * math.log(_POOR):
        factors = _factors(body, units, motion, measured)
        best = factors if misfit_of(factors) < misfit_of(best) + joints * math.log(_FACTORS) else best
    for part in zip(*(np.array_split(x[:: max(1, len(q) // _HALVES)], 2) for x in (q, v, a, torque))):
        before = min(misfit(body, part[:3], part[3]), joints * math.log(left))
        after = misfit(body, best.of(*part[:3]), part[3])
        if after > min(before + 2 * math.log(BETTER), joints * math.log(UNLIKE)):
            return None
    return best


def _factors(body: RigidBody, units: Units, motion: list[Array], torque: Array) -> Map:
    """A factor for each joint's position, as of motors before their gears."""
    arm, none = body.arm, np.zeros(body.joints)
    limit = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    start = limit / 2 / np.maximum(np.abs(motion[0]).max(0), limit / 2)

    def found(x: Array) -> Map:
        factor = start * np.exp(x)
        ratios = ", ".join(f"{y:.3g} ({name})" for y, name in zip(1 / factor, arm.joint_names))
        text = (
            f"positions divided by about {ratios} fit far better: are they those of the motors, before the "
            f"gears? set the gears' own ratios ({units.setting(factor, none, arm.prismatic)})"
        )
        return Map(np.diag(factor), none, text)

    best = scipy.optimize.minimize(
        lambda x: misfit(body, found(x).of(*motion), torque),
        none,
        method="Powell",
        bounds=[(-_FARTHEST, _FARTHEST)] * body.joints,
        options={"xtol": 1e-3, "ftol": 1e-3},
    )
    return found(best.x)
