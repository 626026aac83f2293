"""Builders that validity tests share: regions, arms with hulls, trajectories near their limits."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sidegan.base.arrays import Array, split
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, Capsules
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere
from tests.chains import exact_capsules

HIGHEST = {"acceleration": 8.0, "jerk": 60.0}  # [rad/s², rad/s³]
DESK, BOX = Plane((0.0, 0.0, 1.0), 0.1), Box((-0.7, -0.7, -0.2), (0.7, 0.6, 0.12))
BALL, HULL = Sphere((0.5, 0.3, 0.6), 0.15), Convex.between((0.6, -0.4, 0.2), (0.6, -0.4, 0.9), 0.08)
BLOCK = Convex.around(np.array(np.meshgrid([-0.2, 0.2], [-0.3, 0.3], [-0.1, 0.1])).reshape(3, 8).T)
BENT = (0.0, 0.5, 0.0, -1.3, 0.0, 0.6, 0.0)  # a home of seven joints


def drawn(trajectory: Trajectory, batch: int, seed: int = 0) -> Array:
    generator = np.random.default_rng(seed)
    return generator.standard_normal((batch, *trajectory.shape))


def moderate(arm: Arm, trajectory: Trajectory, batch: int, seed: int) -> Array:
    """Trajectories around the limits: some inside, some outside, (batch, J, H, 2)."""
    generator = np.random.default_rng(seed)
    c = generator.standard_normal((batch, *trajectory.shape))
    motion = trajectory.roll_out(c, trajectory.times(50.0))
    room = (arm.position_upper - arm.position_lower) / 2
    away = np.abs(motion.position - np.array(trajectory.home)).max(1) / room
    use = np.maximum(away, np.abs(motion.velocity).max(1) / arm.velocity_limit)
    share = generator.uniform(0.05, 1.2, (batch, 1))
    return c * (share / use)[:, :, None, None]


def filled(arm: Arm, seed: int) -> Arm:
    """The same arm, with random hulls inside of its capsules, and a few that are the capsules themselves."""
    random = np.random.default_rng(seed)
    capsules = arm.capsules
    corners, exact = [], random.random(len(capsules.radius)) < 0.2
    for k, (a, b, radius) in enumerate(zip(capsules.a, capsules.b, capsules.radius.tolist())):
        beside = random.normal(size=(20, 3))
        beside *= radius * random.uniform(0.2, 1.0, (20, 1)) / np.linalg.norm(beside, axis=1, keepdims=True)
        corners.append(np.stack([a, b]) if exact[k] else a + random.random((20, 1)) * (b - a) + beside)
    pieces = replace(
        capsules,
        corners=np.concatenate(corners),
        start=np.array([0, *np.cumsum([*map(len, corners)])]),
        rounding=np.where(exact, capsules.radius, 0.0),
        core=0.8 * capsules.radius,
        exact=exact,
    )
    return replace(arm, capsules=pieces)


def only(capsules: Capsules, which: Array) -> Capsules:
    owners = tuple(capsules.owners[k] for k in which.tolist())
    arrays = (x[which] for x in (capsules.link, capsules.a, capsules.b, capsules.radius))
    return exact_capsules(*arrays, owners)


def holding(planar: Arm, share: float) -> Arm:
    """The planar arm, for which holding its links level takes a share of its torque limits."""
    level = np.array([[np.pi / 2, 0.0]])
    torque = np.abs(RigidBody(planar).torque(level, 0 * level, 0 * level)[0])
    return replace(planar, torque_limit=torque / share if share else np.full(2, np.inf))


def limited(arm: Arm, names: Sequence[str], share: float = 1.0) -> Arm:
    """An arm with some limits of acceleration and jerk; of every third joint there is none."""
    free = np.arange(arm.joints) % 3 == 2
    limits = {name: share * HIGHEST[name] * arm.velocity_limit for name in names}
    return replace(arm, **{f"{name}_limit": np.where(free, np.inf, x) for name, x in limits.items()})


def margins_of(constraints: Constraints, trajectory: Trajectory, c: Array, times: Array) -> dict:
    """Margins (B, T, K) by constraint."""
    states = (trajectory.derivative(c, times, order) for order in range(constraints.orders))
    margins = constraints.margins(*(x.reshape(-1, constraints.arm.joints) for x in states))
    return {name: margin.reshape(len(c), len(times), -1) for name, margin in margins.items()}


def smallest(constraints: Constraints, trajectory: Trajectory, c: Array, rate: float) -> dict[str, Array]:
    """Smallest margin over the period, (B,), by constraint, at a sampling rate [Hz]."""
    times = trajectory.times(rate)
    least: dict[str, list[Array]] = {name: [] for name in constraints.labels}
    for part in split(c, max(1, 20_000 // len(times))):
        for name, margin in margins_of(constraints, trajectory, part, times).items():
            least[name].append(margin.min((1, 2)))
    return {name: np.concatenate(found) for name, found in least.items()}
