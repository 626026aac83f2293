"""Expected errors of what is identified from noisy torques, in closed form: no noise is drawn.

An estimate is linear in noise on torques. With the information M = Σ wⱼ² Yⱼᵀ Yⱼ + 1/P₀, and S = Σ wⱼ⁴ σ² yᵀ y
over equations y with noise of variance σ², the covariance of the parameters is C = M⁻¹ S M⁻¹. The tests' Yⱼ
turns it into errors of expected square tr(Yⱼᵀ Yⱼ C), besides those that the prior makes.
"""

import pandas as pd
import torch

from sidegan.identification.fit import least_residual, least_squares
from sidegan.identification.gather import gather
from sidegan.identification.measurements import Measurements, Noise, pieces
from sidegan.identification.model import RIGID, TorqueModel
from sidegan.identification.settings import StudySettings
from sidegan.identification.study import MotionSet, measured
from sidegan.identification.sums import Sums, no_sums, sums_of
from sidegan.motion.dynamics import RigidBody


def expected_errors(
    body: RigidBody, family: MotionSet, tests: MotionSet, settings: StudySettings
) -> pd.DataFrame:
    """NMSE of a set that ``study.compare`` finds on average over noise draws, by weighting and joint.

    The weights of joints follow from the noise alone. No rows where states are noisy.
    """
    model, noise, rows = TorqueModel(body, RIGID), settings.noise, list[tuple[object, ...]]()
    exact, truth = (list(measured(body, one, settings.rate)) for one in (family, tests))
    sums, judged, spread = gather(model, exact).sums, gather(model, truth).sums, _noise(model, exact, noise)
    for weighted in () if noise.state and noise.level else (False, True):
        weights = torch.ones_like(sums.energy)
        if weighted:  # by one over the deviation of the joint's noise, bounded as estimated ones are
            weights = 1 / torch.maximum((spread.energy / spread.weight).sqrt(), least_residual(sums))
        fit = least_squares(sums, 1 / settings.prior, weights)
        covariance = fit.inverse @ spread.weighted(weights.square())[0] @ fit.inverse
        squares = judged.squares(fit.parameters) + torch.einsum("jpq,qp->j", judged.information, covariance)
        nmse = squares / judged.weight / judged.variance
        rows += [(weighted, *row) for row in zip(model.arm.joint_names, nmse.tolist())]
    return pd.DataFrame(rows, columns=["weighted", "joint", "nmse"])


def _noise(model: TorqueModel, exact: list[Measurements], noise: Noise) -> Sums:
    """Sums over equations that count with the variance of their noise, which the energy has, too."""
    sums, share = no_sums(model.joints, model.count), noise.level**2 / 3 * noise.torque
    for part in pieces(exact):
        variance = share * part.torque.square()
        one = sums_of(model.regressor(*part.states) * variance.sqrt()[..., None], part.torque)
        sums = sums.plus(one._replace(energy=variance.sum(0)))
    return sums
