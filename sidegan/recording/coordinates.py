"""What recorded positions may be in place of the joints': in other units, of motors, swapped, coupled."""

import math
from collections.abc import Iterator, Sequence
from itertools import combinations, pairwise, product
from typing import NamedTuple

import numpy as np
import scipy  # submodules load lazily

from sidegan.base.arrays import Array
from sidegan.base.settings_text import suggestion
from sidegan.motion.dynamics import RigidBody
from sidegan.recording import thresholds
from sidegan.recording.misfit import halves_of, misfit, subset
from sidegan.recording.settings import RecordingSettings
from sidegan.recording.units import Units
from sidegan.robot import Arm
from sidegan.robot.sources import read_source
from sidegan.robot.units import transmissions

_FEW = 500  # samples to compare positions by
_HALVES = 2_000  # samples, in two halves, in which the best are compared again
_FARTHEST = 1.5  # largest logarithm of a factor, from where the joints reach half of their limits
_SHARES = {"per cent of each joint's range (−100 to 100)": (-100, 100), "shares of it (−1 to 1)": (-1, 1)}
_SHARES |= {"per cent of each joint's range (0 to 100)": (0, 100), "shares of it (0 to 1)": (0, 1)}


class Map(NamedTuple):
    """The joints' positions as M q + z of recorded ones q, with what to say where they explain torques."""

    matrix: Array  # M, (J, J)
    zero: Array  # z [rad or m], (J,)
    text: str  # ends with the setting or change of the file that makes it so
    torque: Array | None = None  # of the joints' torques from recorded ones, (J, J); None: as recorded

    def of(self, q: Array, v: Array, a: Array, torque: Array) -> tuple[Array, Array, Array, Array]:
        """Positions, velocities, accelerations and torques, (S, J) each, of recorded ones."""
        torque = torque if self.torque is None else torque @ self.torque.T
        return q @ self.matrix.T + self.zero, v @ self.matrix.T, a @ self.matrix.T, torque


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
    if units.angle in (None, "rad") and units.position is None:
        degrees, way = np.where(arm.prismatic, 1.0, math.pi / 180), suggestion("recording.units.angle", "deg")
        yield Map(np.diag(degrees), none, f"are these degrees? ({way})")


def couplings(names: Sequence[str]) -> Iterator[tuple[str, Array, Array]]:
    """Usual couplings of neighbours: what they look like, and matrices (J, J) of positions and torques."""
    own = np.eye(len(names))
    for pair in pairwise(range(len(names))):
        for (j, k), sign in product((pair, pair[::-1]), (-1.0, 1.0)):
            motion = own + sign * np.outer(own[j], own[k])
            angle = f"the position of {names[j]} looks counted from {names[k]}'s, as from the horizontal"
            yield angle, motion, own
            belt = f"the motors of {names[j]} and {names[k]} look coupled, as by a belt"
            yield belt, motion, np.linalg.inv(motion).T
        text = "{} and {} look driven by a differential".format(*(names[j] for j in pair))
        for mean, one, other in product((0, 1), (-0.5, 0.5), (-0.5, 0.5)):
            motion = own.copy()
            motion[np.ix_(pair, pair)] = np.roll([[one, one], [other, -other]], mean, 0)
            yield text, motion, np.linalg.inv(motion).T


def _columns(arm: Arm, settings: RecordingSettings, poor: bool) -> Iterator[Map]:
    """Maps from reversed, swapped and coupled joints, and, if the fit is poor, from motors before gears."""
    names, own = arm.joint_names, np.eye(arm.joints)
    found = [(f"the axis of {name} looks reversed", own - 2 * np.diag(x)) for name, x in zip(names, own)]
    maps = [*((text, x, x) for text, x in found), *couplings(names)]
    if poor:
        motors = transmissions(read_source(arm.urdf, arm.setup.args).root, names)
        torques = [own, np.linalg.inv(motors).T]
        text = "positions look like those of the motors before the transmissions in the description"
        maps += [(text, motors, x) for x in torques[: 1 + (np.count_nonzero(motors) > arm.joints)]]
    for j, k in combinations(range(arm.joints), 2):
        both = own - np.outer(own[j] - own[k], own[j] - own[k])
        maps.append((f"the motions of {names[j]} and {names[k]} look swapped", both, own))
    for text, motion, torque in maps:
        way = settings.coupled(names, motion, torque)
        yield Map(motion, np.zeros(arm.joints), f"{text}: {way} explains the torques far better", torque)


def positions_behind(
    body: RigidBody, left: float, settings: RecordingSettings, q: Array, v: Array, a: Array, torque: Array
) -> Map | None:
    """The map with which the description explains torques far better, in both halves of samples (S, J).

    None if there is none. ``left`` is the mean unexplained share without a map, with the best gravity.
    """
    arm, joints, units = body.arm, body.joints, settings.units
    signals = q, v, a, torque
    few = subset(signals, _FEW)
    same = Map(np.eye(joints), np.zeros(joints), "")

    def misfit_of(x: Map) -> float:
        return misfit(body, *x.of(*few))

    best = min([same, *_units(arm, units), *_columns(arm, settings, left > thresholds.POOR)], key=misfit_of)
    if misfit_of(best) > joints * math.log(thresholds.POOR):
        factors = _factors(body, units, few)
        if misfit_of(factors) < misfit_of(best) + joints * math.log(thresholds.EXPLAINED_BY_RATIOS):
            best = factors
    better, like = 2 * math.log(thresholds.EXPLAINED_BY_MAP), joints * math.log(thresholds.LEFT_BY_MAP)
    for part in halves_of(subset(signals, _HALVES)):
        before = min(misfit(body, *part), joints * math.log(left))
        if misfit(body, *best.of(*part)) > min(before + better, like):
            return None
    return best


def _factors(body: RigidBody, units: Units, signals: list[Array]) -> Map:
    """A factor for each joint's position, as of motors before their gears."""
    arm, none = body.arm, np.zeros(body.joints)
    limit = np.maximum(np.abs(arm.position_lower), np.abs(arm.position_upper))
    start = limit / 2 / np.maximum(np.abs(signals[0]).max(0), limit / 2)

    def found(x: Array) -> Map:
        factor = start * np.exp(x)
        ratios = ", ".join(f"{y:.3g} ({name})" for y, name in zip(1 / factor, arm.joint_names))
        text = (
            f"positions divided by about {ratios} fit far better: are they those of the motors, before the "
            f"gears? set the gears' own ratios ({units.setting(factor, none, arm.prismatic)})"
        )
        return Map(np.diag(factor), none, text)

    best = scipy.optimize.minimize(
        lambda x: misfit(body, *found(x).of(*signals)),
        none,
        method="Powell",
        bounds=[(-_FARTHEST, _FARTHEST)] * body.joints,
        options={"xtol": 1e-3, "ftol": 1e-3},
    )
    return found(best.x)
