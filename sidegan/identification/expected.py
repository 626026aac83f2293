"""Expected errors of what is identified from noisy torques, in closed form: no noise is drawn.

An estimate is linear in noise on torques. With the information M = Σ wⱼ² Yⱼᵀ Yⱼ + 1/P₀, and S = Σ wⱼ⁴ σ² yᵀ y
over equations y with noise of variance σ², the covariance of the parameters is C = M⁻¹ S M⁻¹. The tests' Yⱼ
turns it into errors of expected square tr(Yⱼᵀ Yⱼ C), besides those that the prior makes.
"""

from collections.abc import Sequence

import pandas as pd
import torch
from torch import Tensor

from sidegan.identification.fit import least_residual, least_squares
from sidegan.identification.gather import gather, weighted_sums
from sidegan.identification.measurements import SAMPLES_AT_ONCE, Measurements, Noise
from sidegan.identification.model import RIGID, TorqueModel
from sidegan.identification.settings import StudySettings
from sidegan.identification.sums import Sums, no_sums
from sidegan.motion.dynamics import RigidBody

COLUMNS = ["weighted", "joint", "nmse"]


def expected_errors(
    body: RigidBody, exact: Sequence[Measurements], tests: Sequence[Measurements], settings: StudySettings
) -> pd.DataFrame:
    """Expected NMSE by weighting and joint; no rows where states are noisy or the recursion forgets.

    The weights of joints follow from the noise alone.

    Args:
        body: of the arm.
        exact: measurements without noise along each trajectory that is identified from.
        tests: measurements without noise along each test trajectory.
        settings: the noise, the prior, and whether joints are weighted, too.
    """
    if (settings.noise.state and settings.noise.level) or settings.forgetting < 1:
        return pd.DataFrame(columns=COLUMNS)
    model = TorqueModel(body, RIGID)
    sums, noise = gather(model, exact).sums, _noise_sums(model, exact, settings.noise)
    judged, rows = gather(model, tests).sums, []
    for weighted in (False, True) if settings.weighted else (False,):
        weights = _weights(sums, noise) if weighted else torch.ones_like(sums.energy)
        fit = least_squares(sums, weights, 1 / settings.prior)
        covariance = fit.inverse @ noise.weighted(weights.square())[0] @ fit.inverse
        squares = judged.squares(fit.parameters) + torch.einsum("jpq,qp->j", judged.information, covariance)
        nmse = squares / judged.weight / judged.variance
        rows += [(weighted, *row) for row in zip(model.arm.joint_names, nmse.tolist())]
    return pd.DataFrame(rows, columns=COLUMNS)


def torque_variance(noise: Noise, torque: Tensor) -> Tensor:
    """Variance of the noise on the torque of one trajectory, (S, J); a third is that of U(−1, 1)."""
    if not noise.torque:
        return torch.zeros_like(torque)
    return (noise.size(torque[None])[0].square() / 3).expand_as(torque)


def _noise_sums(model: TorqueModel, exact: Sequence[Measurements], noise: Noise) -> Sums:
    """Sums over equations that count with the variance of their noise, which the energy has, too."""
    sums = no_sums(model.joints, model.count)
    for whole in exact:
        variance = torque_variance(noise, whole.torque)
        for i in range(0, len(whole), SAMPLES_AT_ONCE):
            some = slice(i, i + SAMPLES_AT_ONCE)
            part = weighted_sums(model, whole[some], variance[some])
            sums = sums.plus(part._replace(energy=variance[some].sum(0)))
    return sums


def _weights(sums: Sums, noise: Sums) -> Tensor:
    """One over the standard deviation of each joint's noise, (J,), bounded as estimated ones are."""
    return 1 / torch.maximum((noise.energy / noise.weight).sqrt(), least_residual(sums))
