"""Torques of a recording beside the arm's description: gravity, scale and sign."""

import math
from itertools import combinations
from typing import NamedTuple

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.gravity import Load, load_of, other_columns, unexplained
from sidegan.recording.recording import Segment
from sidegan.robot import Arm
from sidegan.robot.mounting import direction, in_base, mount_of, straightened

_SAMPLES = 20_000  # enough to tell a sign
_FEW = 2_000  # enough to tell whose motion it is
_CLEAR = 0.4  # correlation with the model that says something
_SURE = 0.9  # correlation from which on a scale is one
_OTHER = 2.0  # times what the description needs, or a part of it: another unit, not another mass
_STILL = 0.1  # [rad or m] that a joint moves through at least where its sign is told
_DRIVEN = 0.02  # of the power, that friction dissipates at least of a torque that is not reversed
_BETTER = 0.3  # of what a joint's own described torque leaves, that another's leaves where they are exchanged
_STRANGE = 4  # times as many joints as agree: the description is hardly that of the arm
_MOST = 0.99  # of the samples have less than the usual torque
_TINY = 1e-12


class Agreement(NamedTuple):
    """Agreement of the measured torque with the arm's description."""

    load: Load  # the gravity and the scales that explain the torques
    order: Array  # the joint whose described torque each joint's is, (J,): itself, unless some are exchanged
    turned: bool  # whether that is another gravity than the description's
    swapped: tuple[int, int] | None  # two joints whose motions are exchanged
    moved: Array  # range of each joint [rad or m], (J,)
    # share of the power that friction dissipates, (J,); negative where the torque would drive the arm's
    # friction
    friction: Array
    usual: Array  # largest torque but for a hundredth of the samples [N·m or N], (J,)
    needed: Array  # the same of what the description's links need [N·m or N], (J,)

    @property
    def sign(self) -> Array:
        """Correlation with the description without friction and rotors, −1 to 1, (J,).

        Near −1 the torque is counted the other way round; near 0 the motion does not tell.
        """
        return self.load.correlation

    @property
    def heavier(self) -> float:
        """Median of measured over needed torque of the joints whose sign is told; 1 where none is."""
        clear = np.abs(self.load.scale[np.abs(self.sign) > _CLEAR])
        return float(np.median(clear)) if len(clear) else 1.0

    @property
    def strange(self) -> bool:
        """Whether hardly any torque is as described."""
        return bool(self.needed.any() and _STRANGE * (self.sign > _CLEAR).sum() <= len(self.sign))

    @property
    def rescaled(self) -> Array:
        """Joints whose torque is a multiple of what the description needs, beyond doubt, (J,)."""
        scale = self.load.scale
        return (self.sign > _SURE) & ((scale > _OTHER) | (scale < 1 / _OTHER))

    def doubts(self, arm: Arm) -> list[str]:
        """Sentences on what cannot be right of both the description and the torques, beside gravity."""
        found = []
        if self.rescaled.any():
            each = zip(arm.joint_names, self.load.scale.tolist(), self.rescaled.tolist())
            shares = listed([f"{scale:.2g} ({name})" for name, scale, marked in each if marked], arm.joints)
            found.append(
                f"measured torques are {shares} times those expected from the description: wrong unit, wrong "
                "gain or wrong masses? (recording.units, robot.gains)"
            )
        if self.strange:
            found.append(
                "hardly any torque matches the description: is this the right arm, and its joint order?"
            )
        return found

    def gravity(self, arm: Arm) -> str | None:
        """Which gravity these torques hold, a sentence; None where it is the description's."""
        if not self.turned:
            return None
        if not self.load.gravity.any():
            return (
                "these torques contain no gravity, although the description's links have mass: a driver that "
                "compensates gravity may leave it out; record the total torque, or add that of gravity"
            )
        found, described = (straightened(in_base(arm, g)) for g in (self.load.gravity, arm.gravity))
        mount = ",".join(f"{round(x, 3) + 0.0:.4g}" for x in mount_of(None, found.tolist()))
        return (
            f"in these torques gravity acts along {direction(found)} of the base, by the description along "
            f"{direction(described)}: is the arm mounted like that? ('robot.mount=[{mount}]')"
        )

    def reversed(self, arm: Arm, driven: bool = False) -> str | None:
        """Which joints' torque looks reversed, a sentence; only where it does not overcome friction if so."""
        against = (self.sign < -_CLEAR) & (self.moved >= _STILL)
        names = arm.named(against & (self.friction < (_DRIVEN if driven else _CLEAR)))
        if not names:
            return None
        return (
            f"the torque of {names} runs against the description: is its sign wrong? "
            f"(recording.reverse=[{names.replace(', ', ',')}])"
        )

    def exchanged(self, arm: Arm) -> str | None:
        """Which joints have each other's torques or motions, a sentence; None where each has its own."""
        moved = [j for j, k in enumerate(self.order.tolist()) if j != k]
        if not moved and self.swapped and not self.turned:
            one, other = (arm.joint_names[j] for j in self.swapped)
            return (
                f"the motions of {one} and {other} look swapped: each one's torque fits the other's "
                "positions; is the order of columns right? (recording.position)"
            )
        if not moved:
            return None
        each = [f"that of {arm.joint_names[j]} fits {arm.joint_names[self.order[j]]}" for j in moved]
        return f"torques look swapped: {', '.join(each)}; is the order of columns right? (recording.torque)"

    def warnings(self, arm: Arm) -> list[str]:
        """All of these doubts, and joints whose sign the motion does not show."""
        silent = (np.abs(self.sign) < _CLEAR) | (self.moved < _STILL)
        said = self.exchanged(arm)
        first = [said] if said else [self.gravity(arm), *self.doubts(arm), self.reversed(arm)]
        warnings = [one for one in first if one]
        if silent.any():
            warnings.append(
                f"the motion does not show whether the sign of the torque of {arm.named(silent)} is right"
            )
        return warnings


def agreement_of(body: RigidBody, segments: list[Segment]) -> Agreement:
    """Agreement of segments with an arm's description."""
    every = max(1, sum(len(segment.time) for segment in segments) // _SAMPLES)
    q, v, a, torque = (np.concatenate([segment[k][::every] for segment in segments]) for k in range(1, 5))
    load = load_of(body, q, v, a, torque)
    model = body.torque(q, v, a)
    usual, needed = (np.quantile(np.abs(x), _MOST, 0) for x in (torque, model))
    return Agreement(
        load=load,
        order=_order(model, v, a, torque),
        swapped=_swapped(body, q, v, a, torque),
        turned=not np.array_equal(load.gravity, body.arm.gravity),
        moved=np.ptp(q, 0),
        friction=_dissipated(model, v, a, torque),
        usual=usual,
        needed=needed,
    )


def _left(model: Array, v: Array, a: Array, torque: Array) -> Array:
    """Share of each measured torque that a described one leaves, with that joint's friction and rotor.

    Of (S, J) each; (J, J), described by measured.
    """
    described, measured = unexplained(v, a, model.T[..., None], torque)  # (J, S, 1), (J, S, J)
    size = np.linalg.norm(described, axis=1) * np.linalg.norm(measured, axis=1)
    cosine = (described.mT @ measured)[:, 0] / np.maximum(size, _TINY)
    return np.maximum(1 - np.square(cosine), _TINY)


def _order(model: Array, v: Array, a: Array, torque: Array) -> Array:
    """The joint whose described torque (S, J), with its friction and rotor, each measured one is, (J,)."""
    own = np.arange(model.shape[1])
    left = _left(model, v, a, torque)
    found = scipy.optimize.linear_sum_assignment(np.log(left).T)[1]
    other = found != own
    clear = left[found, own] < _BETTER * left.diagonal()
    return found if clear[other].all() else own


def _swapped(body: RigidBody, *states: Array) -> tuple[int, int] | None:
    """Two joints with whose motions exchanged far more of the torques is explained, of (S, J) each."""
    *motion, torque = (x[:: max(1, len(x) // _FEW)] for x in states)

    def left(*pair: int) -> float:
        """What the description leaves of the torques, the sum over joints of logarithms."""
        order = np.arange(body.joints)
        order[[*pair]] = pair[::-1]
        q, v, a = (x[:, order] for x in motion)
        return float(np.log(_left(body.torque(q, v, a), v, a, torque).diagonal()).sum())

    found = {pair: left(*pair) for pair in combinations(range(body.joints), 2)}
    best = min(found, key=found.__getitem__, default=None)
    return best if best and found[best] < left() + 2 * math.log(_BETTER) else None


def _dissipated(model: Array, v: Array, a: Array, torque: Array) -> Array:
    """Share of the power that friction dissipates, (J,), of (S, J) each; see ``Agreement``."""
    columns = np.concatenate([other_columns(v, a), model[..., None]], 2).swapaxes(0, 1)  # (J, S, 5)
    weights = np.stack([np.linalg.lstsq(*each)[0] for each in zip(columns, torque.T)])
    friction = (columns[..., :2] @ weights[:, :2, None])[..., 0].T
    power = np.maximum(np.sqrt(np.square(torque).mean(0) * np.square(v).mean(0)), _TINY)
    return (friction * v).mean(0) / power
