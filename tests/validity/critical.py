"""Builders of the room: segments, arms with hulls, trajectories that are critical in one constraint alone."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import torch
from torch import Tensor

from sidegan.kernels.chain import Chain, Shapes
from sidegan.motion.arrays import chain_of, shapes_of
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, Capsules, load_robot
from sidegan.robot.arm import Pieces
from sidegan.validity import Box, Constraints, Convex, Plane, Region, Sphere
from sidegan.validity.regions import tables

HIGHEST = {"acceleration": 8.0, "jerk": 60.0}  # [rad/s², rad/s³]
DESK, BOX = Plane((0.0, 0.0, 1.0), 0.1), Box((-0.7, -0.7, -0.2), (0.7, 0.6, 0.12))
BALL, HULL = Sphere((0.5, 0.3, 0.6), 0.15), Convex.between((0.6, -0.4, 0.2), (0.6, -0.4, 0.9), 0.08)
BLOCK = Convex.around(np.array(np.meshgrid([-0.2, 0.2], [-0.3, 0.3], [-0.1, 0.1])).reshape(3, 8).T)
BENT = (0.0, 0.5, 0.0, -1.3, 0.0, 0.6, 0.0)  # a home of seven joints


def drawn(trajectory: Trajectory, batch: int, seed: int = 0) -> Tensor:
    generator = torch.Generator().manual_seed(seed)
    return torch.randn(batch, *trajectory.shape, generator=generator, dtype=torch.float64)


def random_segments(count: int, seed: int = 0, sets: int = 1) -> tuple[Tensor, ...]:
    """Both ends of segments [m], (3, count) each, of one set after another."""
    generator = torch.Generator().manual_seed(seed)
    return (0.6 * torch.randn(2 * sets, 3, count, generator=generator, dtype=torch.float64)).unbind()


def segments_as_capsules(
    a: Sequence[Tensor], b: Sequence[Tensor], pairs: Tensor, guarded: Tensor, regions: Sequence[Region] = ()
) -> tuple[Chain, Shapes]:
    """Sets of segments with end points (3, N) as capsules on the base of the planar arm, of radius zero."""
    ends = [torch.cat([*x], 1).T.contiguous() for x in (a, b)]
    none = torch.zeros(len(ends[0]), dtype=torch.float64)
    capsules = Capsules(none.long() - 1, *ends, none, *2 * [("",) * len(none)])
    return chain_of(load_robot("planar2")), shapes_of(capsules, pairs, guarded, tables(regions))


def moderate(arm: Arm, trajectory: Trajectory, batch: int, seed: int) -> Tensor:
    """Trajectories around the limits: some inside, some outside, (batch, J, H, 2)."""
    generator = torch.Generator().manual_seed(seed)
    c = torch.randn(batch, *trajectory.shape, generator=generator, dtype=torch.float64)
    motion = trajectory.roll_out(c, trajectory.times(50.0))
    room = (arm.position_upper - arm.position_lower) / 2
    away = (motion.position - torch.tensor(trajectory.home)).abs().amax(1) / room
    use = torch.maximum(away, motion.velocity.abs().amax(1) / arm.velocity_limit)
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
    names = tuple(capsules.names[k] for k in which.tolist())
    return Capsules(
        capsules.link[which], capsules.a[which], capsules.b[which], capsules.radius[which], names, names
    )


def thick(arm: Arm, factor: float) -> Arm:
    return replace(arm, capsules=replace(arm.capsules, radius=factor * arm.capsules.radius))


def limited(arm: Arm, names: Sequence[str], share: float = 1.0) -> Arm:
    """An arm with some limits of acceleration and jerk; of every third joint there is none."""
    free = torch.arange(arm.joints) % 3 == 2
    limits = {name: share * HIGHEST[name] * arm.velocity_limit for name in names}
    return replace(arm, **{f"{name}_limit": x.where(~free, torch.inf) for name, x in limits.items()})


def margins_of(constraints: Constraints, trajectory: Trajectory, c: Tensor, times: Tensor) -> dict:
    """Margins (B, T, K) by constraint."""
    states = (trajectory.derivative(c, times, order) for order in range(constraints.orders))
    margins = constraints.margins(*(x.flatten(0, 1) for x in states))
    return {name: margin.unflatten(0, (len(c), len(times))) for name, margin in margins.items()}


def smallest(constraints: Constraints, trajectory: Trajectory, c: Tensor, rate: float) -> dict[str, Tensor]:
    """Smallest margin over the period, (B,), by constraint, at a sampling rate [Hz]."""
    times = trajectory.times(rate)
    least: dict[str, list[Tensor]] = {name: [] for name in constraints.labels}
    for part in c.split(max(1, 20_000 // len(times))):
        for name, margin in margins_of(constraints, trajectory, part, times).items():
            least[name].append(margin.amin((1, 2)))
    return {name: torch.cat(found) for name, found in least.items()}
