"""95 % intervals of identified parameters, and whether they hold the plants' own."""

import torch
from torch import Tensor

from sidegan.identification import TorqueModel
from sidegan.plant.varied import VariedPlant
from sidegan.worth.settings import PIECE

NORMAL = 1.96  # standard deviations on either side of which an interval of 95 % ends
PARTS = PIECE  # [s] of motion within which errors may belong together


def deviations(information: Tensor, weights: Tensor, errors: Tensor, prior: Tensor) -> Tensor:
    """Standard deviations of weighted least squares, (P,).

    Args:
        information: of each joint, (J, P, P).
        weights: variances that equations were divided by, (J,).
        errors: variances of errors times how many samples tell as much as one, (J,).
        prior: information that was believed, (P, P).

    Source: White 1980, as in ``identification.accuracy.covariance_of``.
    """
    matrix = prior + (information / weights[:, None, None]).sum(0)
    middle = prior + (information * (errors / weights**2)[:, None, None]).sum(0)
    return _spread(matrix, middle)


def widened(scores: Tensor, matrix: Tensor, prior: Tensor) -> Tensor:
    """Standard deviations (P,) that allow for errors that belong together within each of K parts of a motion.

    What a model lacks is no noise: it comes back with the motion, in all joints at once. Parts of the motion
    are its independent samples.

    Args:
        scores: Σ w Yᵀ r of the residuals r of each part, all its repetitions together, (K, P).
        matrix: Σ w YᵀY and the prior, (P, P).
        prior: information that was believed, (P, P).

    Source: Liang, Zeger 1986; Cameron, Miller 2015 for the factor K / (K − 1).
    """
    count = len(scores)
    middle = prior + scores.T @ scores * count / max(1, count - 1)
    return _spread(matrix, middle)


def _spread(matrix: Tensor, middle: Tensor) -> Tensor:
    """Roots of the diagonal of A⁻¹ M A⁻¹, (P,), of A and M (P, P), taken where A has a unit diagonal."""
    unit = matrix.diagonal().sqrt()
    inverse = torch.cholesky_inverse(torch.linalg.cholesky(matrix / unit[:, None] / unit))
    return (inverse @ (middle / unit[:, None] / unit) @ inverse).diagonal().clamp_min(0).sqrt() / unit


def held(parameters: Tensor, deviation: Tensor, true: Tensor) -> Tensor:
    """Share of the true parameters (P,) that 95 % intervals hold, (), of those that are numbers."""
    known = true.isfinite()
    return ((parameters - true).abs() <= NORMAL * deviation)[known].double().mean()


def true_parameters(plant: VariedPlant, model: TorqueModel) -> Tensor:
    """Parameters of a plant, (P,); not numbers those of friction that is not of the model's class."""
    law, joints = plant.law, model.joints
    own = {"rotor_inertia": plant.rotor}
    if linear := law.form == "linear" and law.settings.width == model.terms.sign_width:
        own |= {"viscous": law.viscous, "coulomb": law.coulomb}
    standard = torch.zeros(model.mapping.shape[1], dtype=torch.float64)
    standard[: 10 * joints] = plant.true.inertial_parameters.reshape(-1)
    for kind in model.kinds:
        if kind in own:
            standard[model.standard_slice(kind)] = torch.from_numpy(own[kind])
    true = model.mapping @ standard
    if not linear:
        kinds = [model.kinds[k // joints] for k in model.extras.tolist()]
        true[model.rigid :][torch.tensor([kind not in own for kind in kinds], dtype=torch.bool)] = torch.nan
    return true
