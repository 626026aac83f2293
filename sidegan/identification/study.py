"""Compare excitation sets: identify from each, predict test torques, and repeat with new noise.

Least-squares sums are additive, so that combinations of sets and replications cost no more than their parts.

Source: Jegorova et al. 2020, experiments 1 and 2.
"""

from collections.abc import Iterable, Mapping, Sequence
from functools import reduce
from typing import Any, TypeAlias

import numpy as np
import pandas as pd

from sidegan.base.arrays import Array, split
from sidegan.base.parallel import Report
from sidegan.design.excitation import excitation_of
from sidegan.identification.estimate import score
from sidegan.identification.fit import gather, least_residual, least_squares, weighted_least_squares
from sidegan.identification.measurements import Measurements, add_noise, exact_measurements, pieces
from sidegan.identification.model import RIGID, TorqueModel
from sidegan.identification.settings import StudySettings
from sidegan.identification.sums import Sums, no_sums, sums_of, sums_of_draws
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory

MotionSet: TypeAlias = tuple[Trajectory, Array]  # the array: coefficients [rad/s], (N, J, H, 2)

_RATE = 5.0  # sampling rate of the condition number [Hz]
_TRAJECTORIES_AT_ONCE = 10


def drawn_errors(
    body: RigidBody,
    name: str,
    family: MotionSet,
    tests: MotionSet,
    settings: StudySettings,
    random: np.random.SeedSequence,
    progress: Report,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """NMSE of models identified from a set, by repeat, weighting and joint, and facts about the set.

    A repeat draws the same noise for every set. Test torques are exact: an nMSE is the model's error alone.
    Progress is that of ``measured_sums``.

    Returns:
        Results (columns set, repeat, weighted, joint, nmse) and facts (set, repeat, covariance_norm,
        samples, condition of the stacked YᵀY, duration [s]).
    """
    draws = measured_sums(body, family, settings, random.spawn(settings.repeats), progress)
    each = ({"set": name, "repeat": k} for k in range(settings.repeats))
    results, facts = _judged(body, zip(each, draws), tests, settings)
    trajectory, coefficients = family
    samples = max(round(trajectory.period * _RATE), 4 * trajectory.harmonics)
    stacked = gram(body, trajectory, coefficients, samples).mean(0, keepdims=True)
    condition = float(excitation_of(body, stacked).eigenvalue_fitness[0])
    return results, facts.assign(condition=condition, duration=trajectory.period * len(coefficients))


def measured_sums(
    body: RigidBody,
    family: MotionSet,
    settings: StudySettings,
    randoms: Sequence[np.random.SeedSequence],
    progress: Report,
) -> list[Sums]:
    """Least-squares sums over all N trajectories of a set, for each draw of noise; progress counts to N."""
    model = TorqueModel(body, RIGID)
    count = len(family[1])
    done = 0
    generators = [np.random.default_rng(seed) for seed in randoms]
    sums = [no_sums(model.joints, model.count) for _ in generators]
    for batch in split(family[1], _TRAJECTORIES_AT_ONCE) if count else ():
        exact = _measured(body, (family[0], batch), settings.rate)
        noisy = (add_noise(exact, settings.noise, generator, len(batch)) for generator in generators)
        if settings.noise.state:
            parts = [gather(model, draw).sums for draw in noisy]
        else:  # the draws share the regressor
            parts = sums_of_draws(model.regressor(*exact.states), np.stack([draw.torque for draw in noisy]))
        sums = [before.plus(new) for before, new in zip(sums, parts)]
        done += len(batch)
        progress(done, count)
    return sums


def combined_errors(
    body: RigidBody, sets: Mapping[str, Sequence[Sums]], tests: MotionSet, settings: StudySettings
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """As ``drawn_errors``, for named lists of sums to add up; without repeat, condition and duration."""
    each = [({"set": name}, reduce(Sums.plus, parts)) for name, parts in sets.items()]
    return _judged(body, each, tests, settings)


def expected_errors(
    body: RigidBody, family: MotionSet, tests: MotionSet, settings: StudySettings
) -> pd.DataFrame:
    """Expectation of ``drawn_errors`` over the noise, by weighting and joint, in closed form.

    An estimate is linear in noise on torques. With the information M = Σ wⱼ² Yⱼᵀ Yⱼ + 1/P₀ and
    S = Σ wⱼ⁴ σ² yᵀ y over equations y with noise variance σ², the covariance is C = M⁻¹ S M⁻¹. The expected
    squared error on the tests is tr(Yⱼᵀ Yⱼ C) plus the bias due to the prior. The weights of joints follow
    from the noise alone. Without rows if states are noisy.
    """
    model = TorqueModel(body, RIGID)
    noise = settings.noise
    exact = _measured(body, family, settings.rate)
    sums = gather(model, exact).sums
    # over equations scaled by their noise's standard deviation; the energy sums its variance
    spread = no_sums(model.joints, model.count)
    share = noise.level**2 / 3 * noise.torque
    for part in pieces(exact):
        variance = share * np.square(part.torque)
        scaled = sums_of(model.regressor(*part.states) * np.sqrt(variance)[..., None], part.torque)
        spread = spread.plus(scaled._replace(energy=variance.sum(0)))
    judged = gather(model, _measured(body, tests, settings.rate)).sums
    rows: list[tuple[object, ...]] = []
    for weighted in () if noise.state and noise.level else (False, True):
        weights = np.ones_like(sums.energy)
        if weighted:  # by the joint's noise, with the bound of ``weighted_least_squares``
            weights = 1 / np.maximum(np.sqrt(spread.energy / spread.weight), least_residual(sums))
        fit = least_squares(sums, 1 / settings.prior, weights)
        covariance = fit.inverse @ spread.weighted(np.square(weights))[0] @ fit.inverse
        squares = judged.squares(fit.parameters) + np.einsum("jpq,qp->j", judged.information, covariance)
        nmse = squares / judged.weight / judged.variance
        rows += [(weighted, *row) for row in zip(model.arm.joint_names, nmse.tolist())]
    return pd.DataFrame(rows, columns=["weighted", "joint", "nmse"])


def _measured(body: RigidBody, family: MotionSet, rate: float) -> Measurements:
    """Exact measurements along all trajectories of a set, one after another."""
    trajectory, coefficients = family
    return exact_measurements(body, trajectory.roll_out(coefficients, trajectory.times(rate)))


def _judged(
    body: RigidBody, each: Iterable[tuple[dict[str, Any], Sums]], tests: MotionSet, settings: StudySettings
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Errors on exact test torques of models identified from sums, and facts about these; with their keys.

    Errors with equal weights and with weights per joint; ‖diag P‖ with equal weights, and samples.
    """
    model = TorqueModel(body, RIGID)
    truth = _measured(body, tests, settings.rate)
    errors, facts = [], []
    for keys, sums in each:
        fits = [least_squares(sums, 1 / settings.prior), weighted_least_squares(sums, 1 / settings.prior)]
        for weighted, fit in enumerate(fits):
            nmse = score(model, fit.parameters, truth).nmse.tolist()
            columns = {"weighted": bool(weighted), "joint": model.arm.joint_names, "nmse": nmse}
            errors.append(pd.DataFrame({**keys, **columns}))
        norm = np.linalg.vector_norm(fits[0].inverse.diagonal())
        facts.append({**keys, "covariance_norm": norm, "samples": round(float(sums.weight))})
    return pd.concat(errors, ignore_index=True), pd.DataFrame(facts)
