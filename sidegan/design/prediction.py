"""How well sets of trajectories predict torques: errors that least squares is expected to make.

A trajectory has the information M = Σ wⱼ² yᵀ y on the base parameters, over joints and times, and noise
S = Σ wⱼ⁴ σ² yᵀ y where torques have noise of variance σ² and joint j's equations y count by wⱼ. Those of a
set are their sums. An estimate's covariance is then M⁻¹ S M⁻¹, and torques that it predicts have the expected
squared error tr(V M⁻¹ S M⁻¹), V being the information of the motions whose torques are predicted.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array, flatten, split
from sidegan.design.coordinates import Coordinates
from sidegan.design.problem import Problem
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.threads import eigh
from sidegan.motion.trajectory import Trajectory

SAMPLES = 40  # of a trajectory, whose sums differ by less than 1 % from those of many more
_PER_HARMONIC = 7  # of a trajectory with many harmonics
TOGETHER, DRAWS = 35, 200  # trajectories of a set, as the paper has it, and sets that are drawn
_STATES_AT_ONCE = 4096  # whose regressor is kept: 10 MB at seven joints
_STATES, _PACE = 1000, 0.5  # random ones, and their share of the velocity limits
_FLOOR = 0.02  # of the largest joint's torque, that a small joint's counts as at least
_STILL = 1e-12  # of the mean square: a torque of smaller variance does not vary
_ROUNDING = 16  # an eigenvalue below 16 p ε of the largest is rounding


@dataclass(frozen=True, eq=False)
class TorqueNoise:
    """Noise on measured torques, and how much the joints' equations count."""

    weights: Array  # what each joint's equations are multiplied with, (J,)
    level: float  # uniform noise as a share of the torque, τ (1 + level · U(−1, 1))
    deviation: Array  # of noise of one size whatever the torque [N·m or N], (J,)

    @classmethod
    def proportional(cls, level: float, weights: Array) -> "TorqueNoise":
        """Noise in proportion to the torque, as the paper has it, with equal weights or others."""
        return cls(weights, level, np.zeros_like(weights))

    @classmethod
    def constant(cls, body: RigidBody, share: float) -> "TorqueNoise":
        """Noise of a share of each joint's torque limit, whose inverse is the weight.

        Where the arm states no limit it is a share of the largest torque over random states.
        """
        limit = body.arm.torque_limit
        if not np.isfinite(limit).all():
            limit = np.where(np.isfinite(limit), limit, _largest_torque(body))
        return cls(1 / (share * limit), 0.0, share * limit)

    def variance(self, torque: Array) -> Array:
        """Variance of the noise on torques, (…, J)."""
        return self.level**2 / 3 * np.square(torque) + np.square(self.deviation)


def _largest_torque(body: RigidBody) -> Array:
    """Largest torque of each joint over random states [N·m or N], not below a share of the largest one's."""
    arm, random = body.arm, np.random.default_rng(0)
    speed, size = _PACE * arm.velocity_limit, (_STATES, arm.joints)
    q = random.uniform(arm.position_lower, arm.position_upper, size)
    dq, ddq = random.uniform(-speed, speed, (2, *size))
    largest = np.abs(body.torque(q, dq, ddq)).max(0)
    return np.maximum(largest, _FLOOR * largest.max())


@dataclass(frozen=True, eq=False)
class Prediction:
    """Expected errors of the torques that are predicted from what was measured along trajectories.

    The estimate is that of recursive least squares with P₀ = 1 / least: a direction that nothing excites
    stays at zero, and is wrong by all that it is.
    """

    body: RigidBody
    trajectory: Trajectory  # the family of the trajectories
    wanted: Array  # information of the torques that are to be predicted, by ``wanted_torques``, (K, p, p)
    noise: TorqueNoise
    times: Array  # at which torques are measured [s], (T,)
    each: float = 1.0  # measurements that stand at each of the times
    least: float = 1e-6  # information that there is of each parameter before

    @classmethod
    def at_rate(
        cls,
        body: RigidBody,
        trajectory: Trajectory,
        wanted: Array,
        noise: TorqueNoise,
        rate: float = 100.0,
        prior: float = 1e6,
    ) -> "Prediction":
        """Errors after measurements at a rate [Hz], for which ``sampled`` times stand; P₀ = prior · I."""
        times = sampled(trajectory)
        each = trajectory.period * rate / len(times)
        return cls(body, trajectory, wanted, noise, times, each=each, least=1 / prior)

    def informations(self, c: Array) -> tuple[Array, Array]:
        """Information M and noise S of trajectories [rad/s] (N, J, H, 2), (N, p, p) each."""
        both = []
        for y, torque in _equations(self.body, self.trajectory, c, self.times):
            weighted = self.noise.weights[:, None] * y
            noisy = (self.noise.weights * np.sqrt(self.noise.variance(torque))).mT[:, None] * weighted
            both.append([x @ x.mT for x in (flatten(weighted, 2), flatten(noisy, 2))])
        information, noise = (self.each * np.concatenate(x) for x in zip(*both))
        return information, noise

    def nmse(self, information: Array, noise: Array) -> Array:
        """Expected nMSE of each joint whose torque varies, (B, K), of sets with such sums, (B, p, p) each."""
        inverse = inverse_of(information, self.least)
        bias = self.least * inverse @ self.body.base.values
        squares = inverse @ noise @ inverse + bias[:, :, None] * bias[:, None]
        return flatten(squares, 1) @ flatten(self.wanted, 1).T

    def of_draws(self, c: Array, count: int = TOGETHER, draws: int = DRAWS, seed: int = 0) -> Array:
        """Expected nMSE, (draws, K), of sets of so many trajectories drawn from c (N, J, H, 2), at random."""
        if len(c) < count:
            raise ShapeError(f"a set of {count} trajectories cannot be drawn from {len(c)}")
        random = np.random.default_rng(seed)
        picks = random.random((draws, len(c))).argsort(1)[:, :count]
        chosen = np.zeros((draws, len(c)))
        np.put_along_axis(chosen, picks, 1.0, 1)
        sums = [np.tensordot(chosen, x, 1) for x in self.informations(c)]
        return self.nmse(*sums)


def error_slope(wanted: Array, information: Array, noise: Array) -> tuple[Array, Array]:
    """Directions in which a set's expected error falls with its information, (p, p), and their shares, (p,).

    With the mean information M and noise S of a set's trajectories, the error of joint k is tr(Vₖ M⁻¹ S M⁻¹)
    over their number. Small joints count in the mean logarithm of the joints' errors, large ones in the
    logarithm of the mean: half of each falls by 2 tr(A Mᵢ) for a trajectory's Mᵢ more, A = M⁻¹ V M⁻¹ S M⁻¹
    made symmetric, where V weighs the Vₖ so that tr(A M) = 1. In directions v with vᵀ M v = 1, which are the
    columns, that is 2 Σ b vᵀ Mᵢ v, with the shares b in descending order. Their sum is one, but for those
    below zero, which are left out. What a trajectory adds to S is left out, too.
    """
    scale = np.sqrt(np.maximum(information.diagonal(), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(information / scale / scale[:, None])
    values = np.maximum(values, _ROUNDING * len(scale) * np.finfo(float).eps * values[-1])
    white = vectors / np.sqrt(values) / scale[:, None]  # whiteᵀ M white = 1
    wanted, noise = white.T @ wanted @ white, white.T @ noise @ white
    errors = (wanted * noise).sum((1, 2))
    weighed = (wanted / errors[:, None, None] + wanted / errors.mean()).mean(0) / 2
    slope = weighed @ noise
    shares, turned = np.linalg.eigh(-(slope + slope.T) / 2)  # the largest first
    return white @ turned, np.maximum(-shares, 0)


def sampled(trajectory: Trajectory) -> Array:
    """Times [s] whose sums stand for those of many more, (T,)."""
    return trajectory.grid(max(SAMPLES, _PER_HARMONIC * trajectory.harmonics))


def inverse_of(information: Array, least: float) -> Array:
    """Inverse of information + least · I, (B, p, p), by eigenvalues in units of the diagonal."""
    scale = np.sqrt(np.linalg.diagonal(information) + least)
    units = scale[:, :, None] * scale[:, None]
    values, vectors = eigh((information + least * np.eye(scale.shape[1])) / units)
    rounding = _ROUNDING * scale.shape[1] * np.finfo(float).eps
    values = np.maximum(values, rounding * values[:, -1:])
    return (vectors / values[:, None]) @ vectors.mT / units


def wanted_torques(body: RigidBody, trajectory: Trajectory, c: Array, times: Array) -> Array:
    """Information of exact torques along trajectories over each joint's variance of torque, (K, p, p).

    For a parameter error e, eᵀ V e is the nMSE. Joints whose torque does not vary have none.
    """
    torques, parts = [], []
    for y, torque in _equations(body, trajectory, c, times):
        rows = flatten(y.transpose(2, 1, 0, 3), 2)  # (J, p, n T)
        parts.append(rows @ rows.mT)
        torques.append(torque.reshape(-1, body.joints))
    torque = np.concatenate(torques)
    variance, information = torque.var(0), np.stack(parts).sum(0)
    varies = variance > _STILL * np.square(torque).mean(0)
    return information[varies] / len(torque) / variance[varies, None, None]


def torque_size(body: RigidBody, trajectory: Trajectory, c: Array) -> Array:
    """Root mean square torque of each joint along trajectories [N·m or N], (J,)."""
    torques = [torque for _, torque in _equations(body, trajectory, c, sampled(trajectory))]
    return np.sqrt(np.square(np.concatenate(torques)).mean((0, 1)))


def random_motions(problem: Problem, count: int = 20, reach: float = 0.55, seed: int = 99) -> Array:
    """Motions within the limits on motion, each joint using a share of its tightest one, (count, J, H, 2)."""
    natural, random = Coordinates.of(problem), np.random.default_rng(seed)
    return natural.coefficients(natural.start(problem, count, random, reach))


def _equations(
    body: RigidBody, trajectory: Trajectory, c: Array, times: Array
) -> Iterator[tuple[Array, Array]]:
    """Base regressor, (n, p, J, T), and torque, (n, T, J), along some of the trajectories after others."""
    for part in split(c, max(1, _STATES_AT_ONCE // len(times))):
        states = trajectory.roll_out(part, times)[1:]
        y = body.base_regressor(*states)  # (n, T, J, p)
        yield y.transpose(0, 3, 2, 1), y @ body.base.values
