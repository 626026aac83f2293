"""Ways to pick a set from one pool, compared: how well each set identifies the arm."""

import time
from collections.abc import Callable

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from sidegan.design.criteria import criteria_of
from sidegan.design.greedy import greedy
from sidegan.design.information import Information, information_of
from sidegan.design.optimal import a_optimal, ceiling, d_optimal
from sidegan.errors import ShapeError
from sidegan.identification import StudySettings, study
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

_RATE = 5.0  # [Hz] at which information is taken: 80 samples in 16 s
_LEAST = 1e-3  # of a joint's largest torque: one that hardly loads a joint does not tell all about it
_AT_ONCE = 200  # trajectories rolled out: 16,000 states

Pick = Callable[[int], Tensor]


def compare(
    body: RigidBody,
    pool: study.Family,
    diagonals: Tensor,
    tests: study.Family,
    settings: StudySettings,
    count: int,
    random: np.random.SeedSequence,
) -> pd.DataFrame:
    """What each way to pick ``count`` trajectories of one pool is worth, a row each.

    Args:
        body: the true dynamics.
        pool: family and coefficients [rad/s] of the candidates, (N, J, H, 2).
        diagonals: of their YᵀY over the base columns, (N, p), for the paper's score.
        tests: family and coefficients of the test trajectories.
        settings: of the simulated measurements and the identification.
        count: how many are picked.
        random: of the random pick and of the noise, which is the same for all.

    Returns:
        Columns method, seconds (of the pick), information_seconds (before, for all but the paper's pick and
        chance), log_det and log_det_most (with the prior; what no set exceeds), condition, covariance_norm,
        nmse and nmse_weighted (means over joints and repeats), nmse_spread and nmse_weighted_spread (their
        deviations over repeats).

    Raises:
        ShapeError: when pool, diagonals and count do not fit each other.
    """
    trajectory, c = pool
    if len(diagonals) != len(c):
        raise ShapeError(f"{len(diagonals)} diagonals do not belong to {len(c)} trajectories")
    noise, chance = random.spawn(2)
    start = time.perf_counter()
    plain, weighted = informations(body, pool)
    spent = (time.perf_counter() - start) / 2
    rows, sets = [], {}
    for name, pick in methods(plain, weighted, diagonals, chance).items():
        start = time.perf_counter()
        chosen = pick(count)
        seconds = time.perf_counter() - start
        condition = criteria_of(plain.stacked(chosen)).condition
        rows.append((name, seconds, spent, *ceiling(plain, chosen), condition))
        sets[name] = (trajectory, c[chosen])
    columns = ["method", "seconds", "information_seconds", "log_det", "log_det_most", "condition"]
    frame = pd.DataFrame(rows, columns=columns).set_index("method")
    results, facts = study.compare(body, sets, tests, settings, noise)
    frame["covariance_norm"] = facts.groupby("set").covariance_norm.mean()
    each = results.groupby(["set", "weighted", "repeat"]).nmse.mean().groupby(["set", "weighted"])
    for values, end in ((each.mean(), ""), (each.std(ddof=0), "_spread")):
        names = {False: f"nmse{end}", True: f"nmse_weighted{end}"}
        frame = frame.join(values.unstack("weighted").rename(columns=names))
    return frame.reset_index()


def informations(body: RigidBody, pool: study.Family) -> tuple[Information, Information]:
    """Information of the candidates: with equal noise, and with noise in proportion to each one's torques."""
    trajectory, c = pool
    samples = max(round(trajectory.period * _RATE), 4 * trajectory.harmonics)
    plain = information_of(body, trajectory, c, samples)
    sizes = torque_sizes(body, trajectory, c, samples)
    sizes = sizes.maximum(_LEAST * sizes.amax(0))
    return plain, information_of(body, trajectory, c, samples, sizes)


def torque_sizes(body: RigidBody, trajectory: Trajectory, c: Tensor, samples: int) -> Tensor:
    """Root mean square of every trajectory's and joint's torque [N·m or N], (N, J)."""
    times = trajectory.grid(samples)
    motions = (trajectory.roll_out(part, times)[1:] for part in c.split(_AT_ONCE))
    return torch.cat([body.torque(*states).square().mean(1).sqrt() for states in motions])


def methods(
    plain: Information, weighted: Information, diagonals: Tensor, random: np.random.SeedSequence
) -> dict[str, Pick]:
    """Every way to pick, by name: the paper's first, chance last."""
    generator = torch.Generator().manual_seed(int(random.generate_state(1)[0]))
    order = torch.randperm(len(plain), generator=generator)
    return {
        "greedy": lambda count: greedy(diagonals, count),
        "D": lambda count: d_optimal(plain, count),
        "A": lambda count: a_optimal(plain, count),
        "D, by noise": lambda count: d_optimal(weighted, count),
        "A, by noise": lambda count: a_optimal(weighted, count),
        "prediction": lambda count: a_optimal(weighted, count, target=weighted.mean),
        "random": lambda count: order[:count],
    }
