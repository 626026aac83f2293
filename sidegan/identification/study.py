"""Compare excitation sets: identify from each, predict test torques, again and again with new noise.

The sums of least squares over a set are added to those of others, so that every combination of sets and
replications costs no more than its parts.

Source: Jegorova et al. 2020, experiments 1 and 2.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import reduce
from typing import TypeAlias

import numpy as np
import pandas as pd
import torch
from torch import Tensor

from sidegan.design.excitation import excitation_of
from sidegan.errors import ConfigError
from sidegan.identification.expected import expected_errors
from sidegan.identification.fit import recursive
from sidegan.identification.gather import gather
from sidegan.identification.measurements import Measurements, Noise, disturbed, measure
from sidegan.identification.model import RIGID, TorqueModel
from sidegan.identification.score import score
from sidegan.identification.settings import StudySettings
from sidegan.identification.sums import Sums, no_sums
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory

MotionSet: TypeAlias = tuple[Trajectory, Tensor]  # and coefficients [rad/s], (N, J, H, 2)
Progress: TypeAlias = Callable[[int, int], None]

_RATE = 5.0  # [Hz] at which YᵀY of a set is taken
_TRAJECTORIES_AT_ONCE = 10


def compare(
    body: RigidBody,
    sets: Mapping[str, MotionSet],
    tests: MotionSet,
    settings: StudySettings,
    random: np.random.SeedSequence,
    progress: Progress | None = None,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """NMSE of every set, weighting, repeat and joint, and facts about every set.

    The same repeat draws the same noise for every set. Test torques are exact, so that an nMSE is the
    error of the model and not of its judge. Progress receives (done, total) after every identification.

    Returns:
        Results (columns set, repeat, weighted, joint, nmse) and facts (set, repeat, covariance_norm,
        samples, condition of the stacked YᵀY, duration [s]).
    """
    judge = _Judge(body, tests, settings, ["set", "repeat"])
    children, stacked = random.spawn(settings.repeats), {}
    for done, (name, family) in enumerate(sets.items()):
        stacked[name] = _stacked_condition(body, family), family[0].period * len(family[1])
        exact = list(_measured(body, family, settings.rate))
        for repeat, child in enumerate(children):
            generator = np.random.default_rng(child)
            noisy = (disturbed(one, settings.noise, generator) for one in exact)
            data = gather(judge.model, noisy, settings.forgetting)
            judge.identify((name, repeat), data.sums, data.samples)
            if progress is not None:
                progress(done * settings.repeats + repeat + 1, len(sets) * settings.repeats)
    results, facts = judge.frames()
    columns = pd.DataFrame([stacked[name] for name in facts["set"]], columns=["condition", "duration"])
    facts[["condition", "duration"]] = columns
    return results, facts


def expected(body: RigidBody, family: MotionSet, tests: MotionSet, settings: StudySettings) -> pd.DataFrame:
    """NMSE of a set that ``compare`` finds on average over noise draws, as of ``expected_errors``."""
    exact, truth = (list(_measured(body, one, settings.rate)) for one in (family, tests))
    return expected_errors(body, exact, truth, settings)


def measured_sums(
    body: RigidBody,
    family: MotionSet,
    settings: StudySettings,
    random: np.random.SeedSequence,
    progress: Progress | None = None,
) -> Sums:
    """Sums of least squares over all N trajectories of a set, measured once with noise.

    Arguments are as for ``compare``; progress receives (done, N).
    """
    generator, count = np.random.default_rng(random), len(family[1])
    model = TorqueModel(body, RIGID)
    if not count:
        return no_sums(model.joints, model.count)

    def data() -> Iterator[Measurements]:
        parts = _measured(body, family, settings.rate, settings.noise, generator, _TRAJECTORIES_AT_ONCE)
        for k, part in enumerate(parts, start=1):
            yield part
            if progress is not None:
                progress(min(k * _TRAJECTORIES_AT_ONCE, count), count)

    return gather(model, data()).sums


def combined(
    body: RigidBody, sets: Mapping[str, Sequence[Sums]], tests: MotionSet, settings: StudySettings
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """NMSE of every set, weighting and joint, and the covariance norm and number of samples of every set.

    Arguments are as for ``compare``, but ``sets`` has the sums that are identified from together.

    Returns:
        Results (columns set, weighted, joint, nmse) and facts (set, covariance_norm, samples).

    Raises:
        ConfigError: when the recursion forgets: sums have no order in time.
    """
    if settings.forgetting < 1:
        raise ConfigError(f"sums cannot be added with forgetting factor {settings.forgetting}, expected 1")
    judge = _Judge(body, tests, settings, ["set"])
    for name, parts in sets.items():
        sums = reduce(Sums.plus, parts)
        judge.identify((name,), sums, round(float(sums.weight)))
    return judge.frames()


def _measured(
    body: RigidBody,
    family: MotionSet,
    rate: float,
    noise: Noise | None = None,
    random: np.random.Generator | None = None,
    at_once: int = 1,
) -> Iterator[Measurements]:
    """Measurements of the trajectories of a set, so many at once; exact ones without noise."""
    trajectory, coefficients = family
    times = trajectory.times(rate)
    for c in coefficients.split(at_once):
        yield measure(body, trajectory.roll_out(c, times), noise, random)


class _Judge:
    """Identification from sums, and its errors on the exact torques of test trajectories, as tables."""

    def __init__(self, body: RigidBody, tests: MotionSet, settings: StudySettings, keys: list[str]) -> None:
        self.model, self._settings, self._keys = TorqueModel(body, RIGID), settings, keys
        self._truth = list(_measured(body, tests, settings.rate))
        self._results, self._facts = list[tuple[object, ...]](), list[tuple[object, ...]]()

    def identify(self, key: tuple[object, ...], sums: Sums, samples: int) -> None:
        """Rows of identification with equal weights, and where set with one per joint."""
        settings = self._settings
        for weighted in (False, True) if settings.weighted else (False,):
            fit = recursive(sums, samples, settings.prior, settings.forgetting, weighted)
            errors = score(self.model, fit.parameters, self._truth).nmse.tolist()
            self._results += [(*key, weighted, *row) for row in zip(self.model.arm.joint_names, errors)]
            if not weighted:
                norm = torch.linalg.vector_norm(fit.inverse.diagonal())
                self._facts.append((*key, float(norm), samples))

    def frames(self) -> tuple[pd.DataFrame, pd.DataFrame]:
        """All rows: errors, and norms ‖diag P‖ with equal weights."""
        return (
            pd.DataFrame(self._results, columns=[*self._keys, "weighted", "joint", "nmse"]),
            pd.DataFrame(self._facts, columns=[*self._keys, "covariance_norm", "samples"]),
        )


def _stacked_condition(body: RigidBody, family: MotionSet) -> float:
    """Condition number of YᵀY over all trajectories of a set."""
    trajectory, coefficients = family
    samples = max(round(trajectory.period * _RATE), 4 * trajectory.harmonics)
    grams = gram(body, trajectory, coefficients, samples)
    return float(excitation_of(body, grams.mean(0, keepdim=True)).eigenvalue_fitness)
