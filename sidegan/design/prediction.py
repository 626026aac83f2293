"""Expected errors of the torques that a model identified from a set of trajectories predicts.

A trajectory has information M = Σ wⱼ² yᵀ y on the base parameters, over joints and times, and noise
S = Σ wⱼ⁴ σ² yᵀ y, with noise variance σ² and weight wⱼ of joint j's equations y. Both add up over a set. The
covariance of the estimate is M⁻¹ S M⁻¹, and the expected squared error of predicted torques is
tr(V M⁻¹ S M⁻¹), with V the information of the motions to predict.
"""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from sidegan.base.arrays import Array, flatten, split
from sidegan.design.objective import Goal
from sidegan.design.problem import Coordinates, Problem
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

LEAST_TIMES = 40  # least samples per trajectory: more change the sums by less than 1 %
_PER_HARMONIC = 7  # least samples per harmonic
TOGETHER, DRAWS = 35, 200  # trajectories per set, as in the paper, and number of random sets
_STATES_AT_ONCE = 4096  # per regressor: 10 MB at seven joints
_STATES, _PACE = 1000, 0.5  # random states for typical torques, and their share of the velocity limits
_FLOOR = 0.02  # lower bound of a joint's torque, as a share of the largest joint's
_STILL = 1e-12  # share of the mean square below which the variance of a torque is rounding
_ROUNDING = 16  # an eigenvalue below 16 p ε of the largest is rounding


@dataclass(frozen=True, eq=False)
class TorqueNoise:
    """Noise on measured torques, and weights of the joints' equations."""

    weights: Array  # of each joint's equations, (J,)
    level: float  # uniform noise relative to the torque, τ (1 + level · U(−1, 1))
    deviation: Array  # standard deviation of noise independent of the torque [N·m or N], (J,)

    @classmethod
    def proportional(cls, level: float, weights: Array) -> "TorqueNoise":
        """Noise proportional to the torque, as in the paper."""
        return cls(weights, level, np.zeros_like(weights))

    @classmethod
    def constant(cls, body: RigidBody, share: float) -> "TorqueNoise":
        """Constant noise, a share of each joint's torque limit, with inverse weights.

        Without a limit, it is a share of the joint's largest torque over random states, of which each joint
        has at least 2 % of the largest joint's.
        """
        arm, limit = body.arm, body.arm.torque_limit
        if not np.isfinite(limit).all():
            random = np.random.default_rng(0)
            speed = _PACE * arm.velocity_limit
            size = (_STATES, arm.joints)
            q = random.uniform(arm.position_lower, arm.position_upper, size)
            largest = np.abs(body.torque(q, *random.uniform(-speed, speed, (2, *size)))).max(0)
            limit = np.where(np.isfinite(limit), limit, np.maximum(largest, _FLOOR * largest.max()))
        return cls(1 / (share * limit), 0.0, share * limit)


@dataclass(frozen=True, eq=False)
class Prediction:
    """Expected errors of predicted torques, after measuring torques along trajectories.

    The estimate is that of recursive least squares with P₀ = 1 / least: directions without excitation stay at
    zero.
    """

    body: RigidBody
    trajectory: Trajectory  # the family of the trajectories
    wanted: Array  # information of the torques to predict, from ``wanted_torques``, (K, p, p)
    noise: TorqueNoise
    times: Array  # of the measurements [s], (T,)
    each: float = 1.0  # measurements that each time represents
    least: float = 1e-6  # prior information on each parameter

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
        """Errors after measurements at a rate [Hz], represented by ``sample_times``; P₀ = prior · I."""
        times = sample_times(trajectory)
        each = trajectory.period * rate / len(times)
        return cls(body, trajectory, wanted, noise, times, each=each, least=1 / prior)

    @property
    def goal(self) -> Goal:
        """Goal of a search: the error of one trajectory, summed over joints, with constant noise alone."""
        values, vectors = np.linalg.eigh(self.wanted.sum(0))
        kept = values > _ROUNDING * len(values) * np.finfo(float).eps * values[-1]
        return Goal(
            "variance",
            prior=self.least * np.eye(len(values)),
            certainty=1 / self.noise.deviation,
            rate=self.each * len(self.times) / self.trajectory.period,
            targets=(vectors[:, kept] * np.sqrt(values[kept])).T,
        )

    def informations(self, c: Array) -> tuple[Array, Array]:
        """Information M and noise S, (N, p, p) each, of trajectories [rad/s], (N, J, H, 2)."""
        information, noise = list[Array](), list[Array]()
        by = self.noise
        for y, torque in _equations(self.body, self.trajectory, c, self.times):
            weighted = by.weights[:, None] * y
            variance = by.level**2 / 3 * np.square(torque) + np.square(by.deviation)
            noisy = (by.weights * np.sqrt(variance)).mT[:, None] * weighted
            rows = flatten(weighted, 2)
            information.append(rows @ rows.mT)
            rows = flatten(noisy, 2)
            noise.append(rows @ rows.mT)
        return self.each * np.concatenate(information), self.each * np.concatenate(noise)

    def nmse(self, information: Array, noise: Array) -> Array:
        """Expected nMSE, (B, K), of each joint whose torque varies, from sums over sets, (B, p, p) each."""
        inverse = inverse_of(information, self.least)
        bias = self.least * inverse @ self.body.base.values
        squares = inverse @ noise @ inverse + bias[:, :, None] * bias[:, None]
        return flatten(squares, 1) @ flatten(self.wanted, 1).T

    def of_draws(self, c: Array, count: int = TOGETHER, draws: int = DRAWS, seed: int = 0) -> Array:
        """Expected nMSE, (draws, K), of random sets of ``count`` trajectories from c, (N, J, H, 2)."""
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
    over their number. The objective is half the mean logarithm of the joints' errors, where small joints
    count, and half the logarithm of the mean, where large ones do. Adding a trajectory with Mᵢ reduces it by
    2 tr(A Mᵢ), where A is the symmetric part of M⁻¹ V M⁻¹ S M⁻¹, and V weights the Vₖ so that tr(A M) = 1. In
    directions v, the columns, with vᵀ M v = 1, this is 2 Σ b vᵀ Mᵢ v with shares b in descending order. They
    add up to one, except that negative shares are set to zero. The change of S is neglected.
    """
    scale = np.sqrt(np.maximum(information.diagonal(), np.finfo(float).tiny))
    values, vectors = np.linalg.eigh(information / scale / scale[:, None])
    values = np.maximum(values, _ROUNDING * len(scale) * np.finfo(float).eps * values[-1])
    white = vectors / np.sqrt(values) / scale[:, None]  # whiteᵀ M white = 1
    wanted, noise = white.T @ wanted @ white, white.T @ noise @ white
    errors = (wanted * noise).sum((1, 2))
    weighted = (wanted / errors[:, None, None] + wanted / errors.mean()).mean(0) / 2
    slope = weighted @ noise
    shares, rotation = np.linalg.eigh(-(slope + slope.T) / 2)  # negated: largest first
    return white @ rotation, np.maximum(-shares, 0)


def sample_times(trajectory: Trajectory) -> Array:
    """Times [s], (T,), sufficient for sums over a period."""
    return trajectory.grid(max(LEAST_TIMES, _PER_HARMONIC * trajectory.harmonics))


def inverse_of(information: Array, least: float) -> Array:
    """Inverse of information + least · I, (B, p, p), by eigenvalues in units of the diagonal."""
    scale = np.sqrt(np.linalg.diagonal(information) + least)
    units = scale[:, :, None] * scale[:, None]
    values, vectors = np.linalg.eigh((information + least * np.eye(scale.shape[1])) / units)
    rounding = _ROUNDING * scale.shape[1] * np.finfo(float).eps
    values = np.maximum(values, rounding * values[:, -1:])
    return (vectors / values[:, None]) @ vectors.mT / units


def wanted_torques(body: RigidBody, trajectory: Trajectory, c: Array, times: Array) -> Array:
    """Information of exact torques along trajectories over each joint's torque variance, (K, p, p).

    For a parameter error e, eᵀ V e is the nMSE. Joints with constant torque are left out.
    """
    torques, parts = [], []
    for y, torque in _equations(body, trajectory, c, times):
        rows = flatten(y.transpose(2, 1, 0, 3), 2)  # (J, p, n T)
        parts.append(rows @ rows.mT)
        torques.append(torque.reshape(-1, body.joints))
    torque = np.concatenate(torques)
    variance = torque.var(0)
    information = np.stack(parts).sum(0)
    varies = variance > _STILL * np.square(torque).mean(0)
    return information[varies] / len(torque) / variance[varies, None, None]


def torque_size(body: RigidBody, trajectory: Trajectory, c: Array) -> Array:
    """Root mean square torque of each joint along trajectories [N·m or N], (J,)."""
    torques = [torque for _, torque in _equations(body, trajectory, c, sample_times(trajectory))]
    return np.sqrt(np.square(np.concatenate(torques)).mean((0, 1)))


def random_motions(problem: Problem, count: int = 20, reach: float = 0.55, seed: int = 99) -> Array:
    """Random motions, (count, J, H, 2), each joint using the share ``reach`` of its tightest limit."""
    natural = Coordinates.of(problem)
    random = np.random.default_rng(seed)
    return natural.coefficients(natural.start(problem, count, random, reach))


def _equations(
    body: RigidBody, trajectory: Trajectory, c: Array, times: Array
) -> Iterator[tuple[Array, Array]]:
    """Base regressor, (n, p, J, T), and torque, (n, T, J), along batches of the trajectories."""
    for part in split(c, max(1, _STATES_AT_ONCE // len(times))):
        states = trajectory.roll_out(part, times)[1:]
        y = body.base_regressor(*states)  # (n, T, J, p)
        yield y.transpose(0, 3, 2, 1), y @ body.base.values
