"""The error on held-out tasks of what is identified, as the robot moves on."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from sidegan.design.prediction import lacking
from sidegan.identification import TorqueModel
from sidegan.identification.accuracy import inflation_of
from sidegan.identification.prior import belief
from sidegan.motion.trajectory import Motion
from sidegan.plant.friction import Array
from sidegan.plant.varied import Signals, VariedPlant
from sidegan.worth.intervals import Lacking, bias, deviations, held, recurring, true_parameters
from sidegan.worth.orders import SetOf
from sidegan.worth.settings import PIECE, Regime, Sensors, WorthSettings

_TIMES = (1, 2, 3, 4, 5, 6, 7, 8, 10, 12, 14, 16, 20, 24, 28, 32, 40, 48, 60, 72, 88, 112, 140)  # pieces
_REWEIGHTED = 3
FIRST = 0.05  # share of a joint's torque that its residual is taken for at first


class Truth(NamedTuple):
    """A plant on the tasks, without noise: means over samples and joints of relative squares."""

    information: Tensor  # of each joint over its torque's variance, (J, P, P)
    moment: Tensor  # (J, P)
    energy: Tensor  # (J,)

    def errors(self, parameters: Tensor) -> Tensor:
        """Root mean square error of each joint relative to its torque, (…, J), of parameters (…, P)."""
        twice = torch.einsum("jp,...p->...j", self.moment, parameters)
        squares = torch.einsum("jpq,...p,...q->...j", self.information, parameters, parameters)
        return (self.energy - 2 * twice + squares).clamp_min(1e-12).sqrt()

    def floor(self) -> Tensor:
        """The smallest mean error that parameters of the model's class reach, ()."""
        scale = self.information.sum(0).diagonal().clamp_min(1e-300).sqrt()
        matrix = self.information.sum(0) / scale[:, None] / scale
        best = torch.linalg.pinv(matrix, rtol=1e-10, hermitian=True) @ (self.moment.sum(0) / scale) / scale
        return mean_error(self.errors(best))


class Curves(NamedTuple):
    """What sets of a contender tell of one plant in one regime."""

    errors: Tensor  # relative error of each joint after each time, (sets, T, J)
    # share of the true parameters that 95 % intervals hold at the end, (sets,), of those that the plant has
    covered: Tensor
    widened: Tensor  # the same of intervals that allow for what the model lacks, (sets,)


class Followed(NamedTuple):
    """What sensors see of trajectories, or of pieces of them, without noise."""

    regressor: Tensor  # (n, S, J, P)
    torque: Tensor  # (n, S, J)
    friction: Tensor  # (n, S, J)
    lacking: Tensor  # torques that the model may lack, of the sizes that are to be expected, (n, S, J, K)


class Repeated(NamedTuple):
    """A set in pieces that are executed again and again, without noise."""

    regressor: Tensor  # (n, S, J, P)
    torque: Tensor  # (n, S, J)
    friction: Tensor  # (n, S, J)
    gram: Tensor  # of each joint, (n, J, P, P)
    lacking: Lacking  # along each piece

    @classmethod
    def of(cls, parts: Followed, period: float) -> "Repeated":
        """Pieces of whole trajectories (n, S, …)."""
        y, torque, friction, lacks = (_pieces(x, period) for x in parts)
        rows = y.transpose(1, 2)
        return cls(y, torque, friction, rows.mT @ rows, Lacking.along(y, lacks))

    def moments(self, torque: Tensor) -> Tensor:
        """Σ Yᵀ τ of torques (R, S, J) of R pieces in a row, of each joint, (R, J, P)."""
        count, total = len(self.torque), len(torque)
        rounds = -(-total // count)
        padded = torch.cat([torque, torque.new_zeros(rounds * count - total, *torque.shape[1:])])
        right = padded.unflatten(0, (rounds, count)).permute(1, 3, 2, 0)  # (n, J, S, rounds)
        return (self.regressor.permute(0, 2, 3, 1) @ right).permute(3, 0, 1, 2).flatten(0, 1)[:total]

    def information(self, executed: Tensor) -> Tensor:
        """Σ YᵀY of the first pieces in a row, as many as each of T numbers says, (T, J, P, P)."""
        count = len(self.torque)
        times = (executed[:, None] + count - 1 - torch.arange(count)) // count  # how often each, (T, n)
        return torch.tensordot(times.double(), self.gram, 1)


def mean_error(errors: Tensor) -> Tensor:
    """Root of the mean over joints of squared relative errors (…, J), (…)."""
    return errors.square().mean(-1).sqrt()


@dataclass(frozen=True)
class Judge:
    """Identifies plants from sets, and judges what came of it."""

    settings: WorthSettings
    model: TorqueModel

    @property
    def times(self) -> Array:
        """Times [s] at which the error is taken, the last of them the horizon."""
        times = PIECE * np.array(_TIMES, dtype=float)
        return np.append(times[times < self.settings.horizon - 1e-9], self.settings.horizon)

    def truth(self, plant: VariedPlant, moves: list[Motion]) -> Truth:
        """A plant on tasks, executed without noise."""
        signals = plant.follow(_padded(moves))
        parts = []
        for i, move in enumerate(moves):
            own = Signals(*(x[i : i + 1, : len(move.time)] for x in signals))
            parts.append(self._samples(own, plant))
        y, torque = torch.cat([p.regressor[0] for p in parts]), torch.cat([p.torque[0] for p in parts])
        rows, torque = y.transpose(0, 1), torque.T
        weight = 1 / (torque.shape[1] * torque.var(1))
        weighted = (rows * weight[:, None, None]).mT
        moment = (weighted @ torque[..., None])[..., 0]
        return Truth(weighted @ rows, moment, weight * torque.square().sum(1))

    def curves(
        self, plant: VariedPlant, sets: list[SetOf], truth: Truth, regimes: dict[str, Regime], seed: int
    ) -> dict[str, Curves]:
        """What sets tell of a plant, by regime."""
        true = true_parameters(plant, self.model)
        found: dict[str, list[Curves]] = {name: [] for name in regimes}
        for k, (one, parts) in enumerate(zip(sets, self.followed(plant, sets))):
            motion, each = Repeated.of(parts, one.family.period), round(one.family.period / PIECE)
            for name, regime in regimes.items():
                random = np.random.default_rng([seed, k, *name.encode()])
                parameters, *both = self._identified(plant, motion, each, regime, random)
                shares = (held(parameters[-1], deviation, true) for deviation in both)
                found[name].append(Curves(truth.errors(parameters), *shares))
        return {name: Curves(*map(torch.stack, zip(*x))) for name, x in found.items()}

    def followed(self, plant: VariedPlant, sets: Sequence[SetOf]) -> list[Followed]:
        """What sensors see of each set without noise."""
        found: dict[int, Followed] = {}
        for number, first in enumerate(sets):
            if number in found:
                continue
            family = first.family  # those of one family move at once
            alike = [k for k, one in enumerate(sets) if one.family == family]
            motions = torch.cat([sets[k].coefficients for k in alike])
            signals = plant.follow(family.roll_out(motions, _clock(family.period, plant.settings.rate)))
            sizes = [len(sets[k].coefficients) for k in alike]
            samples = self._samples(signals, plant)
            found |= dict(zip(alike, map(Followed._make, zip(*(x.split(sizes) for x in samples)))))
        return [found[k] for k in range(len(sets))]

    def _identified(
        self, plant: VariedPlant, motion: Repeated, each: int, regime: Regime, random: np.random.Generator
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Parameters after each time, (T, P), and their deviations at the end, as they are and widened, (P,).

        A recording is ``each`` pieces long.
        """
        count, total = len(motion.torque), round(self.times[-1] / PIECE)
        order, scale = torch.arange(total) % count, torch.from_numpy(plant.scale)
        measured = motion.torque[order] + disturbed(
            motion.friction[order], plant.scale, self.settings.sensors, regime.drift, each, random
        )
        executed = torch.from_numpy(np.round(self.times / PIECE).astype(int))
        sums = [x.cumsum(0)[executed - 1] for x in (motion.moments(measured), measured.square().sum(1))]
        sums = [motion.information(executed), *sums]
        samples = executed.double() * measured.shape[1]
        parameters, variance, prior = self._estimates(sums, samples, scale)
        residuals = measured - (motion.regressor @ parameters[-1])[order]
        errors = variance[-1] * inflation_of([residuals.flatten(0, 1)])
        told = deviations(sums[0][-1], variance[-1], errors, prior)
        times = torch.bincount(order).double()
        lacks = Lacking(*(torch.tensordot(times, x, 1) for x in motion.lacking))
        off = bias(lacks, sums[0][-1], variance[-1], prior, recurring(residuals, order))
        return parameters, told, (told.square() + off.square()).sqrt()

    def _estimates(self, sums: list[Tensor], samples: Tensor, scale: Tensor) -> tuple[Tensor, Tensor, Tensor]:
        """Weighted least squares with weights from residuals and a weak belief in the description.

        Returns:
            parameters, (T, P), the variance of each joint's residuals, (T, J), and the belief, (P, P).
        """
        information, moment, energy = sums
        prior = belief(self.model, scale, self.settings.believed)
        nominal = self.model.nominal
        variance = (FIRST * scale).square().expand(len(samples), -1)
        for _ in range(_REWEIGHTED):
            matrix = prior + (information / variance[:, :, None, None]).sum(1)
            right = prior @ nominal + (moment / variance[:, :, None]).sum(1)
            unit = matrix.diagonal(dim1=1, dim2=2).sqrt()
            factor = torch.linalg.cholesky(matrix / unit[:, :, None] / unit[:, None])
            x = torch.cholesky_solve((right / unit)[..., None], factor)[..., 0] / unit
            left = energy - 2 * (moment @ x[..., None])[..., 0]
            left = left + torch.einsum("tjpq,tp,tq->tj", information, x, x)
            variance = (left / samples[:, None]).clamp_min(1e-10 * float(scale.min()) ** 2)
            variance = torch.maximum(variance, (1e-3 * scale).square())
        return x, variance, prior

    def _samples(self, signals: Signals, plant: VariedPlant) -> Followed:
        """At the sensors' rate, filtered without delay."""
        states, torque, friction = _seen(signals, plant.settings.rate, self.settings.sensors)
        y = self.model.regressor(*(x.flatten(0, 1) for x in states)).unflatten(0, (len(torque), -1))
        rigid = y[..., : self.model.rigid] @ self.model.body.base.values
        return Followed(y, torque, friction, self.lacking(plant, states[0], states[1], rigid))

    def lacking(self, plant: VariedPlant, q: Tensor, dq: Tensor, torque: Tensor) -> Tensor:
        """Torques that the model may lack, (…, J, K), where rigid bodies make these, (…, J)."""
        scale = torch.from_numpy(plant.scale)
        return lacking(q, dq, torque, scale) * self.settings.misfits.amplitudes(scale)[0].sqrt()


def executed(plant: VariedPlant, one: SetOf, sensors: Sensors) -> tuple[list[Tensor], Tensor, Tensor]:
    """States, torque and friction (n, S, J) of a set as sensors see them, without noise."""
    clock = _clock(one.family.period, plant.settings.rate)
    return _seen(plant.follow(one.family.roll_out(one.coefficients, clock)), plant.settings.rate, sensors)


def _seen(signals: Signals, rate: float, sensors: Sensors) -> tuple[list[Tensor], Tensor, Tensor]:
    """States, torque and friction (B, S, J) at the sensors' rate, filtered without delay."""
    from scipy.signal import butter, sosfiltfilt  # takes half a second to import

    step, sos = round(rate / sensors.rate), butter(2, sensors.cutoff, fs=rate, output="sos")
    q, torque, friction = (sosfiltfilt(sos, x, axis=1) for x in signals[:3])
    dq = np.gradient(q, 1 / rate, axis=1)
    ddq = np.empty_like(q)
    ddq[:, 1:-1] = (q[:, 2:] - 2 * q[:, 1:-1] + q[:, :-2]) * rate**2
    ddq[:, 0], ddq[:, -1] = ddq[:, 1], ddq[:, -2]
    kept = (x[:, step // 2 :: step] for x in (q, dq, ddq, torque, friction))
    *states, torque, friction = (torch.from_numpy(np.ascontiguousarray(x)) for x in kept)
    return states, torque, friction


def disturbed(
    friction: Tensor, scale: Array, sensors: Sensors, drift: bool, each: int, random: np.random.Generator
) -> Tensor:
    """What is added to the torques of pieces (n, S, J): coloured noise, and drift of friction and offset.

    What drifts is constant within a recording of so many pieces, and forgets itself slowly.
    """
    count, samples, joints = friction.shape
    noise = _coloured(random, count * samples, joints, np.exp(-1 / (sensors.rate * sensors.correlation)))
    out = sensors.noise * scale * noise.reshape(count, samples, joints)
    if drift:
        steps = -(-count // each)
        slow = [_coloured(random, steps, joints, np.exp(-each * PIECE / sensors.slow)) for _ in range(2)]
        factor, offset = (x.repeat(each, 0)[:count, None] for x in slow)
        out = out + sensors.temperature * factor * friction.numpy() + sensors.bias * scale * offset
    return torch.from_numpy(out)


def _coloured(random: np.random.Generator, count: int, joints: int, keep: float) -> Array:
    """Gaussian noise of unit variance, (count, joints), that keeps this share of itself from step to step."""
    from scipy.signal import lfilter

    draw = random.standard_normal((count, joints))
    draw[1:] *= np.sqrt(1 - keep**2)
    return lfilter([1.0], [1.0, -keep], draw, axis=0)


def _pieces(x: Tensor, period: float) -> Tensor:
    """Signals of whole trajectories (n, S, …) in pieces, (n · period / PIECE, S', …)."""
    parts = round(period / PIECE)
    size = x.shape[1] // parts
    return x[:, : parts * size].unflatten(1, (parts, size)).flatten(0, 1)


def _clock(period: float, rate: float) -> Tensor:
    """Times [s] of a period at a rate, without its end."""
    return torch.arange(round(period * rate), dtype=torch.float64) / rate


def _padded(moves: list[Motion]) -> Motion:
    """Motions of several lengths as one batch; those that have ended rest where they are."""
    longest = max(moves, key=lambda x: len(x.time))
    columns = []
    for one in moves:
        more = len(longest.time) - len(one.time)
        tail = [x[:, -1:].expand(-1, more, -1) for x in one[1:]]
        columns.append([torch.cat([x, end], 1) for x, end in zip(one[1:], tail)])
    return Motion(longest.time, *(torch.cat(x) for x in zip(*columns)))
