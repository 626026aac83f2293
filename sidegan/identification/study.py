"""Compare excitation sets: identify from each, predict test torques, again and again with new noise."""

from collections.abc import Mapping
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from torch import Tensor

from sidegan.design.excitation import excitation_of
from sidegan.identification.identify import accumulate, evaluate
from sidegan.identification.measurements import Noise, measure
from sidegan.identification.metrics import covariance_norm
from sidegan.identification.rls import Identified
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Motion, Trajectory

if TYPE_CHECKING:
    from collections.abc import Callable, Iterator

Family = tuple[Trajectory, Tensor]

_SILENT = Noise(level=0.0)
_RATE = 5.0  # [Hz] at which YᵀY of a set is taken


@dataclass(frozen=True)
class Settings:
    """How the sets are executed and evaluated.

    Attributes:
        rate: of sampling [Hz].
        prior: P₀ = prior · I.
        forgetting: factor λ of the recursion.
        weighted: also identify with one weight per joint.
        noise: of the simulated measurements; test torques are free of it.
        repeats: noise realisations.
    """

    rate: float
    prior: float
    forgetting: float
    weighted: bool
    noise: Noise
    repeats: int


def compare(
    body: RigidBody,
    sets: Mapping[str, Family],
    tests: Family,
    settings: Settings,
    random: np.random.SeedSequence,
    progress: "Callable[[int, int], None] | None" = None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """NMSE of every set, weighting, repeat and joint, and facts about every set.

    The same repeat draws the same noise for every set. Test torques are exact, so that an nMSE is the
    error of the model and not of its judge.

    Args:
        body: the true dynamics.
        sets: name → family and coefficients of the trajectories that are executed.
        tests: family and coefficients of the test trajectories.
        settings: see ``Settings``.
        random: of the noise.
        progress: told (done, total) after every identification.

    Returns:
        Results (columns set, repeat, weighted, joint, nmse) and facts (set, repeat, covariance_norm,
        condition of the stacked YᵀY, duration [s], samples).
    """
    still = np.random.default_rng(0)
    truth = [measure(body, motion, _SILENT, still) for motion in _motions(tests, settings.rate)]
    results, facts = [], []
    children = random.spawn(settings.repeats)
    for done, (name, family) in enumerate(sets.items()):
        stacked = _stacked_condition(body, family)
        for repeat, child in enumerate(children):
            models = _identify(body, family, settings, np.random.default_rng(child))
            for weighted, model in models.items():
                errors = evaluate(body, model, truth).tolist()
                joints = zip(body.arm.joint_names, errors)
                results += [(name, repeat, weighted, joint, error) for joint, error in joints]
            plain = models[False]
            norm = covariance_norm(plain.covariance)
            duration = family[0].period * len(family[1])
            facts.append((name, repeat, norm, stacked, duration, plain.samples))
            if progress is not None:
                progress(done * settings.repeats + repeat + 1, len(sets) * settings.repeats)
    return (
        pd.DataFrame(results, columns=["set", "repeat", "weighted", "joint", "nmse"]),
        pd.DataFrame(facts, columns=["set", "repeat", "covariance_norm", "condition", "duration", "samples"]),
    )


def _identify(
    body: RigidBody, family: Family, settings: Settings, generator: np.random.Generator
) -> dict[bool, Identified]:
    data = (measure(body, motion, settings.noise, generator) for motion in _motions(family, settings.rate))
    rls = accumulate(body, data, settings.prior, settings.forgetting)
    models = {False: rls.solve()}
    if settings.weighted:
        models[True] = rls.solve_weighted()
    return models


def _motions(family: Family, rate: float) -> "Iterator[Motion]":
    trajectory, coefficients = family
    times = trajectory.times(rate)
    for c in coefficients:
        yield trajectory.roll_out(c[None], times)


def _stacked_condition(body: RigidBody, family: Family) -> float:
    trajectory, coefficients = family
    samples = max(round(trajectory.period * _RATE), 4 * trajectory.harmonics)
    grams = gram(body, trajectory, coefficients, samples)
    return float(excitation_of(body, grams.mean(0, keepdim=True)).eigenvalue_fitness)
