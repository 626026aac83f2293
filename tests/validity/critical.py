"""Builders of the room: segments, arms with hulls, trajectories that are critical in one constraint alone."""

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, Capsules
from sidegan.robot.arm import Pieces
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere

KINDS = ("position", "velocity", "acceleration", "jerk", "torque", "collision", "desk", "box")
HIGHEST = {"acceleration": 8.0, "jerk": 60.0}  # [rad/s², rad/s³]
DESK, BOX = Plane((0.0, 0.0, 1.0), 0.1), Box((-0.7, -0.7, -0.2), (0.7, 0.6, 0.12))
BALL, HULL = Sphere((0.5, 0.3, 0.6), 0.15), Convex.between((0.6, -0.4, 0.2), (0.6, -0.4, 0.9), 0.08)
BENT = (0.0, 0.5, 0.0, -1.3, 0.0, 0.6, 0.0)  # a home of seven joints


def drawn(trajectory: Trajectory, batch: int, seed: int = 0) -> Tensor:
    """Random coefficients."""
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(batch, *trajectory.shape, generator=generator, dtype=torch.float64)


def random_segments(count: int, seed: int = 0) -> tuple[Tensor, Tensor]:
    """Both ends of segments [m], two of (3, count)."""
    generator = torch.Generator().manual_seed(seed)
    return (0.6 * torch.randn(2, 3, count, generator=generator, dtype=torch.float64)).unbind()


def moderate(arm: Arm, trajectory: Trajectory, batch: int, seed: int) -> Tensor:
    """Trajectories around the limits: some inside, some outside, (batch, J, H, 2)."""
    generator = torch.Generator().manual_seed(seed)
    c = torch.randn(batch, *trajectory.shape, generator=generator, dtype=torch.float64)
    motion = trajectory.roll_out(c, trajectory.times(50.0))
    room = (arm.position_upper - arm.position_lower) / 2
    use = torch.maximum(
        (motion.position - torch.tensor(trajectory.home)).abs().amax(1) / room,
        motion.velocity.abs().amax(1) / arm.velocity_limit,
    )
    share = torch.empty(batch, 1, dtype=torch.float64).uniform_(0.05, 1.2, generator=generator)
    return c * (share / use)[:, :, None, None]


def filled(arm: Arm, seed: int) -> Arm:
    """The same arm, with random hulls inside of its capsules, and a few that are the capsules themselves."""
    random = np.random.default_rng(seed)
    capsules = arm.capsules
    corners, exact = [], random.random(len(capsules.radius)) < 0.2
    for k, (a, b, radius) in enumerate(zip(capsules.a.numpy(), capsules.b.numpy(), capsules.radius.tolist())):
        beside = random.normal(size=(20, 3))
        beside *= radius * random.uniform(0.2, 1.0, (20, 1)) / np.linalg.norm(beside, axis=1, keepdims=True)
        corners.append(np.stack([a, b]) if exact[k] else a + random.random((20, 1)) * (b - a) + beside)
    pieces = Pieces(
        corners=torch.from_numpy(np.concatenate(corners)),
        start=torch.tensor([0, *np.cumsum([*map(len, corners)])]),
        radius=torch.where(torch.from_numpy(exact), capsules.radius, 0.0),
        exact=torch.from_numpy(exact),
        fitted=torch.zeros(len(corners), dtype=torch.bool),
        core=0.8 * capsules.radius,
    )
    return replace(arm, capsules=replace(capsules, pieces=pieces))


def only(capsules: Capsules, which: Tensor) -> Capsules:
    """Some of an arm's capsules."""
    names = tuple(capsules.names[k] for k in which.tolist())
    return Capsules(capsules.link[which], capsules.a[which], capsules.b[which], capsules.radius[which], names)


def thick(arm: Arm, factor: float) -> Arm:
    """An arm with thicker capsules."""
    return replace(arm, capsules=replace(arm.capsules, radius=factor * arm.capsules.radius))


def isolated(arm: Arm, kind: str) -> Constraints:
    """Constraints of an arm that only one kind can violate within a few turns of every joint."""
    free = replace(
        arm,
        position_lower=1000 * arm.position_lower,
        position_upper=1000 * arm.position_upper,
        velocity_limit=1000 * arm.velocity_limit,
        torque_limit=torch.full_like(arm.torque_limit, torch.inf),
    )
    bare = replace(free, capsules=only(arm.capsules, torch.arange(0)))
    last = replace(free, capsules=only(arm.capsules, torch.tensor([-1])))
    thick = replace(free, capsules=replace(arm.capsules, radius=arm.capsules.radius + 0.02))
    match kind:
        case "position":
            lower, upper = 0.7 * arm.position_lower, 0.7 * arm.position_upper
            return Constraints(replace(bare, position_lower=lower, position_upper=upper))
        case "velocity":
            return Constraints(replace(bare, velocity_limit=arm.velocity_limit))
        case "acceleration" | "jerk":
            limit = torch.full_like(arm.velocity_limit, HIGHEST[kind])
            return Constraints(replace(bare, **{f"{kind}_limit": limit}))
        case "torque":
            return Constraints(replace(bare, torque_limit=0.4 * arm.torque_limit))
        case "collision":
            return Constraints(thick)
        case "desk":
            return Constraints(last, [DESK])
        case "box":
            return Constraints(last, [BOX])
    raise ValueError(kind)


def limited(arm: Arm, names: Sequence[str], share: float = 1.0) -> Arm:
    """An arm with some limits of acceleration and jerk; of every third joint there is none."""
    free = torch.arange(arm.joints) % 3 == 2
    limits = {
        f"{name}_limit": torch.where(free, torch.inf, share * HIGHEST[name] * arm.velocity_limit)
        for name in names
    }
    return replace(arm, **limits)


def named(kind: str) -> str:
    """The margin that a kind of constraint shows in."""
    return "keep_out" if kind in ("desk", "box") else kind


def margins_at(
    constraints: Constraints, trajectory: Trajectory, c: Tensor, times: Tensor
) -> dict[str, Tensor]:
    """Smallest margin over the elements at each time, (B, T), by constraint."""
    parts: dict[str, list[Tensor]] = {name: [] for name in constraints.labels}
    for piece in c.split(max(1, 20_000 // len(times))):
        states = (trajectory.derivative(piece, times, order) for order in range(constraints.orders))
        margins = constraints.margins(*(x.flatten(0, 1) for x in states))
        for name, margin in margins.items():
            parts[name].append(margin.amin(1).reshape(len(piece), len(times)))
    return {name: torch.cat(pieces) for name, pieces in parts.items()}


def smallest(constraints: Constraints, trajectory: Trajectory, c: Tensor, rate: float) -> dict[str, Tensor]:
    """Smallest margin over the period, (B,), by constraint, at a sampling rate [Hz]."""
    margins = margins_at(constraints, trajectory, c, trajectory.times(rate))
    return {name: margin.amin(1) for name, margin in margins.items()}


def scaled_to(margin: Callable[[Tensor], Tensor], c: Tensor, target: float, most: float = 4.0) -> Tensor:
    """Each trajectory scaled up from rest until its margin, (B,), first falls to the target.

    The margin stays above the target by a hair. Those that never fall so far are left out.
    """
    scales = torch.linspace(0, most, 41, dtype=c.dtype)
    below = torch.stack([margin(c * s) < target for s in scales])
    falls = below.any(0) & ~below[0]
    c, first = c[falls], below.int().argmax(0)[falls]
    low, high = scales[first - 1], scales[first]
    everything = torch.ones(len(below[0]), *c.shape[1:], dtype=c.dtype)
    for _ in range(30):
        middle = (low + high) / 2
        everything[falls] = c * middle[:, None, None, None]
        bad = (margin(everything) < target)[falls]
        low, high = torch.where(bad, low, middle), torch.where(bad, middle, high)
    return c * low[:, None, None, None]
