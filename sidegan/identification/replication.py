"""Many trajectories identified together, and the same ones measured several times over.

The sums of least squares over a set are added to those of others, so that every combination of sets and
replications costs no more than its parts.

Source: Jegorova et al. 2020, experiment 2.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence

import numpy as np
import pandas as pd
from torch import Tensor

from sidegan.errors import ShapeError
from sidegan.identification.identify import accumulate, evaluate
from sidegan.identification.measurements import Measurements, Noise, measure
from sidegan.identification.metrics import covariance_norm
from sidegan.identification.rls import Rls
from sidegan.identification.study import Settings
from sidegan.identification.sums import Sums
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

_TRAJECTORIES_AT_ONCE = 10
_SILENT = Noise(level=0.0)


def measured_sums(
    body: RigidBody,
    trajectory: Trajectory,
    c: Tensor,
    settings: Settings,
    random: np.random.SeedSequence,
    progress: Callable[[int, int], None] | None = None,
) -> Sums:
    """Sums of least squares over all trajectories (N, J, H, 2), measured once with noise.

    Args:
        body: the true dynamics.
        trajectory: the family.
        c: coefficients [rad/s].
        settings: sampling and noise.
        random: of the noise.
        progress: told (done, N).
    """
    generator = np.random.default_rng(random)

    def data() -> Iterator[Measurements]:
        times, done = trajectory.times(settings.rate), 0
        for part in c.split(_TRAJECTORIES_AT_ONCE):
            yield measure(body, trajectory.roll_out(part, times), settings.noise, generator)
            done += len(part)
            if progress is not None:
                progress(done, len(c))

    return accumulate(body, data()).sums


def combined(
    body: RigidBody,
    sets: Mapping[str, Sequence[Sums]],
    tests: tuple[Trajectory, Tensor],
    settings: Settings,
) -> tuple[pd.DataFrame, pd.DataFrame]:
    """NMSE of every set, weighting and joint, and the covariance norm and number of samples of every set.

    Args:
        body: the true dynamics.
        sets: name → sums whose samples are identified from together.
        tests: family and coefficients of the test trajectories, whose torques are exact.
        settings: of the identification.

    Returns:
        Results (columns set, weighted, joint, nmse) and facts (set, covariance_norm, samples).

    Raises:
        ConfigError: with a forgetting factor below 1.
        ShapeError: when a set has no sums.
    """
    trajectory, c = tests
    still, times = np.random.default_rng(0), trajectory.times(settings.rate)
    truth = [measure(body, trajectory.roll_out(one[None], times), _SILENT, still) for one in c]
    results, facts = [], []
    for name, parts in sets.items():
        if not parts:
            raise ShapeError(f"set {name!r} has no sums")
        joints, parameters = parts[0].moment.shape
        rls = Rls(parameters, joints, settings.prior, settings.forgetting)
        for part in parts:
            rls.absorb(part)
        models = {False: rls.solve()} | ({True: rls.solve_weighted()} if settings.weighted else {})
        for weighted, model in models.items():
            errors = evaluate(body, model, truth).tolist()
            results += [(name, weighted, joint, e) for joint, e in zip(body.arm.joint_names, errors)]
        facts.append((name, covariance_norm(models[False].covariance), rls.samples))
    return (
        pd.DataFrame(results, columns=["set", "weighted", "joint", "nmse"]),
        pd.DataFrame(facts, columns=["set", "covariance_norm", "samples"]),
    )
