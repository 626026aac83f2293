"""By how much a recording's torques are later than its motion, from the motion and the torques alone."""

import math
from collections.abc import Callable, Sequence
from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.motion.dynamics import RigidBody
from sidegan.recording.recording import Segment

_SAMPLES = 3000  # that are looked at, spread over the recording
_ROUNDS = 4  # of Gauss-Newton
_SETTLED = 1e-5  # [s]
_STEP = 0.1  # [s] that a single fit goes at most
_NEAR = 0.02  # [s] up to which a single fit is right, and a delay is no reason to warn
_LONGEST = 0.25  # [s]
_FITS = 8  # with what was found taken off
_ROUNDING = 1e-12  # relative eigenvalue that is no information
# samples of a low-passed error, kept ten to a period of the cut-off, that tell as much as one
_CORRELATED = 5.0
_CLEAR = 3.0  # deviations off zero at which a delay is believed
_WORTH = 2e-3  # [s]: a delay that is worth taking off; friction that sticks passes for a smaller one
_ALIKE = 3e-3  # [s] between delays of one arm: friction that sticks passes for some of it


class Delay(NamedTuple):
    """Time by which torques are later than states."""

    seconds: float  # negative where they are earlier
    deviation: float = 0.0  # standard deviation of that [s]
    given: bool = False  # whether it was set, not measured

    @property
    def noticed(self) -> bool:
        """Whether a person should look at it."""
        return self.believed and abs(self.seconds) > _NEAR

    @property
    def believed(self) -> bool:
        """Whether there is one beyond doubt; one as long as the search goes is where that was stopped."""
        return _CLEAR * self.deviation < abs(self.seconds) < _LONGEST

    def statement(self, taken_off: bool) -> str:
        """A sentence on it, and on what became of it."""
        size, when = abs(self.seconds) * 1e3, "earlier" if self.seconds < 0 else "later"
        if self.given:
            return f"torques are taken to be {size:g} ms {when} than the motion, as is set"
        worth = self.believed and abs(self.seconds) > _WORTH
        left = "left as it is" + "; recording.delay=null takes it off" * worth
        said = f"torques are {size:.2g} ± {self.deviation * 1e3:.2g} ms {when} than the motion"
        return f"{said}: {'taken off' if taken_off else left}"


def pooled(delays: Sequence[Delay]) -> Delay | None:
    """The delay that recordings have in common; None of a single one, or where they have not the same."""
    if len(delays) < 2 or not all(0 < one.deviation < math.inf for one in delays):
        return None
    weights = [one.deviation**-2 for one in delays]
    mean = sum(w * one.seconds for w, one in zip(weights, delays)) / sum(weights)
    apart = any(abs(one.seconds - mean) > max(_CLEAR * one.deviation, _ALIKE) for one in delays)
    return None if apart else Delay(mean, sum(weights) ** -0.5)


def measured(body: RigidBody, segments: list[Segment], less: Callable[[float], list[Segment]]) -> Delay:
    """Delay of the torques, however long; ``less`` gives segments that have a delay [s] taken off."""
    taken, found = 0.0, delay_of(body, segments)
    for _ in range(_FITS):
        if abs(found.seconds) <= _NEAR:
            break
        taken = max(-_LONGEST, min(_LONGEST, taken + found.seconds))
        found = delay_of(body, less(taken))
    return Delay(taken + found.seconds, found.deviation)


def delay_of(body: RigidBody, segments: list[Segment]) -> Delay:
    """Delay of the torques, a short one, with which an arm of these kinematics explains them best.

    A torque that is late by d is Y θ − d τ̇. That is fitted with rigid bodies, friction, offsets and rotors,
    so that the description's inertias do not matter; each joint counts by its residual.
    """
    whole = [torch.cat(x) for x in zip(*map(_rates, segments))]
    every = max(1, len(whole[0]) // _SAMPLES)
    q, dq, ddq, torque, sign, rate, bend = (x[::every] for x in whole)
    each = torch.eye(body.joints, dtype=torch.float64)
    others = torch.stack([dq, sign, torch.ones_like(dq), ddq], -1)
    terms = torch.einsum("sjk,ji->sjik", others, each).flatten(2)
    known = torch.cat([body.base_regressor(q, dq, ddq), terms], 2)
    late, deviation = 0.0, float("inf")
    for _ in range(_ROUNDS):
        # where the torque would be if it came earlier by what was found so far
        now = torque + late * rate + late**2 / 2 * bend
        step, deviation = _step(torch.cat([known, -(rate + late * bend)[..., None]], 2), now)
        late = max(-_STEP, min(_STEP, late + step))
        if abs(step) < _SETTLED:
            break
    return Delay(late, deviation)


def _step(columns: Tensor, torque: Tensor) -> tuple[float, float]:
    """The last parameter of weighted least squares on columns (S, J, P), and its deviation."""
    weights = 1 / torque.std(0).clamp_min(1e-300)
    for _ in range(2):
        rows = (columns * weights[:, None]).flatten(0, 1)
        scale = rows.norm(dim=0).clamp_min(1e-300)
        values, vectors = torch.linalg.eigh((rows / scale).T @ (rows / scale))
        kept = values > _ROUNDING * values[-1]
        inverse = (vectors[:, kept] / values[kept]) @ vectors[:, kept].T
        found = inverse @ ((rows / scale).T @ (torque * weights).flatten()) / scale
        weights = 1 / (torque - columns @ found).square().mean(0).sqrt().clamp_min(1e-12 / weights)
    return float(found[-1]), float((_CORRELATED * inverse[-1, -1]).sqrt() / scale[-1])


def _rates(segment: Segment) -> list[Tensor]:
    """A segment's states, torque and sign, with the torque's first and second derivative."""
    step = float(segment.time[1] - segment.time[0])
    rate = torch.gradient(segment.torque, spacing=step, dim=0)[0]
    bend = torch.gradient(rate, spacing=step, dim=0)[0]
    return [x[2:-2] for x in (*segment[1:], rate, bend)]
