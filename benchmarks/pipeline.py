"""Benchmarks of what is built on the physics: seeds, generator, selection, identification."""

import numpy as np
import torch
from torch import Tensor

from benchmarks.setting import Setting
from benchmarks.timing import Row, cost_row, medians, rate_row
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.identification import Rls
from sidegan.seeds.gradient import Gradient
from sidegan.selection import greedy
from sidegan.validity import check

_PAPER_MICROSECONDS = 1400.0  # per generated trajectory and thread
_PAPER_VALIDATED = 32.0  # generated and checked trajectories per second
_PAPER_SEED_MINUTES = 6.0  # per seed
_PAPER = "the paper"
_LIBRARY, _BASE = 100_000, 43


def generation(setting: Setting) -> Row:
    """Cost of a generated trajectory, of an untrained generator of the default size."""
    generator, count = _generator(setting), setting.size(1000)
    (seconds,) = medians(setting.repeats, lambda: generator.sample(count))
    return cost_row("generation", "µs/trajectory", seconds / count * 1e6, _PAPER_MICROSECONDS, _PAPER)


def generate_validate(setting: Setting) -> Row:
    """Generated trajectories, each with its validity proven or refuted, per second."""
    generator, count = _generator(setting), setting.size(200)

    def work() -> None:
        check(setting.constraints, setting.trajectory, generator.sample(count))

    (seconds,) = medians(setting.repeats, work)
    return rate_row("generate_validate", "trajectories/s", count / seconds, _PAPER_VALIDATED, _PAPER)


def seeds(setting: Setting) -> Row:
    """Valid seeds of the default optimiser per CPU minute."""
    count, steps = (5, 30) if setting.quick else (25, 200)
    made = Gradient(steps=steps).optimise(setting.problem, count, np.random.SeedSequence(0))
    rate = len(made) / (made.cpu_seconds / 60)
    return rate_row("seeds", "seeds/CPU minute", rate, 1 / _PAPER_SEED_MINUTES, _PAPER)


def rls(setting: Setting) -> Row:
    """Samples of seven torques taken in per second, beside the textbook's recursion in NumPy."""
    generator = torch.Generator().manual_seed(0)
    count = setting.size(50_000)
    y = torch.randn(count, 7, _BASE, generator=generator, dtype=torch.float64)
    tau = torch.randn(count, 7, generator=generator, dtype=torch.float64)
    few = setting.size(5_000)

    def ours() -> Tensor:
        filtered = Rls(_BASE, 7)
        for rows, torque in zip(y.split(4096), tau.split(4096)):
            filtered.update(rows, torque)
        return filtered.estimate

    ours_seconds, theirs = medians(
        setting.repeats, ours, lambda: _recursion(y[:few].numpy(), tau[:few].numpy())
    )
    return rate_row(
        "rls", "samples/s", count / ours_seconds, few / theirs, "the recursion in NumPy, sample by sample"
    )


def selection(setting: Setting) -> Row:
    """Seconds for the greedy pick of 350 of 100,000, beside NumPy on what is left."""
    count, picks = setting.size(_LIBRARY), setting.size(350)
    generator = torch.Generator().manual_seed(0)
    diagonals = torch.rand(count, _BASE, generator=generator, dtype=torch.float64)
    few = max(1, picks // 10)
    ours, theirs = medians(
        min(setting.repeats, 3), lambda: greedy(diagonals, picks), lambda: _pick(diagonals.numpy(), few)
    )
    return cost_row("greedy", "s", ours, theirs * picks / few, "NumPy, a tenth of it timed")


def _generator(setting: Setting) -> TrajectoryGenerator:
    seeds = setting.start(200)
    scaling = Scaling.fit(seeds)
    network = Generator(*setting.trajectory.shape[:2], shortcut=True)
    network.start_from(scaling.image(seeds))
    arm = setting.arm
    return TrajectoryGenerator(network.eval(), scaling, setting.trajectory, arm.name, arm.digest, "untrained")


def _recursion(y: np.ndarray, tau: np.ndarray) -> np.ndarray:
    """Estimate (p,) by the covariance form: one gain per sample."""
    covariance, estimate = 1e6 * np.eye(y.shape[2]), np.zeros(y.shape[2])
    for rows, torque in zip(y, tau):
        carried = covariance @ rows.T
        gain = np.linalg.solve(np.eye(len(rows)) + rows @ carried, carried.T).T
        estimate = estimate + gain @ (torque - rows @ estimate)
        covariance = covariance - gain @ carried.T
    return estimate


def _pick(diagonals: np.ndarray, count: int) -> list[int]:
    """The greedy pick as one would write it down."""
    left, previous, chosen = np.arange(len(diagonals)), np.zeros(diagonals.shape[1]), []
    for _ in range(count):
        far = np.linalg.norm(diagonals[left] - previous, axis=1)
        total = diagonals[left].sum(1)
        best = left[np.argmax(far / far.max() + total / total.max())]
        chosen.append(int(best))
        previous, left = diagonals[best], left[left != best]
    return chosen
