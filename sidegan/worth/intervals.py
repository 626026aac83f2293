"""95 % intervals of identified parameters, and whether they hold the plants' own."""

from typing import NamedTuple

import torch
from torch import Tensor

from sidegan.identification import TorqueModel
from sidegan.identification.lacking import turned
from sidegan.plant.varied import VariedPlant

NORMAL = 1.96  # standard deviations on either side of which an interval of 95 % ends
_TINY = torch.finfo(torch.float64).tiny


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
    unit = matrix.diagonal().sqrt()  # inverted where the diagonal is one
    inverse = torch.cholesky_inverse(torch.linalg.cholesky(matrix / unit[:, None] / unit))
    return (inverse @ (middle / unit[:, None] / unit) @ inverse).diagonal().clamp_min(0).sqrt() / unit


class Lacking(NamedTuple):
    """What a model may lack along a motion: K torques b of each joint, of sizes that are to be expected."""

    moments: Tensor  # Σ Yᵀ b, (…, J, P, K)
    squares: Tensor  # Σ b², (…, J, K)

    @classmethod
    def along(cls, regressor: Tensor, torques: Tensor) -> "Lacking":
        """Of a motion's regressor (…, S, J, P) and the torques (…, S, J, K)."""
        moments = regressor.movedim(-3, -2).mT @ torques.movedim(-3, -2)
        return cls(moments, torques.square().sum(-3))


def bias(lacking: Lacking, information: Tensor, weights: Tensor, prior: Tensor, coming: Tensor) -> Tensor:
    """Standard deviations of weighted least squares that come of what the model lacks, (P,).

    It is no noise: it comes back with the motion, and more motion of the same kind does not cure it. How
    much of it there is tells what comes back in the residuals: each joint's torques count by as much as they
    would leave of that.

    Args:
        lacking: along the motion.
        information: Σ YᵀY of each joint, (J, P, P).
        weights: variances that equations were divided by, (J,).
        prior: information that was believed, (P, P).
        coming: sum of squares of what comes back in each joint's residuals, (J,), of ``recurring``.
    """
    matrix = prior + (information / weights[:, None, None]).sum(0)
    wrong = turned(matrix, 1 / weights, lacking.moments)
    left = torch.einsum("pkl,jpq,qkl->j", wrong, information, wrong) + lacking.squares.sum(1)
    left = left - 2 * torch.einsum("jpk,pjk->j", lacking.moments, wrong)
    share = coming / left.clamp_min(_TINY)
    return (wrong.square().sum(2) @ share).sqrt()


def recurring(residuals: Tensor, order: Tensor) -> Tensor:
    """Sum of squares of what comes back in residuals (R, S, J) whenever a piece of motion does, (J,).

    The pieces have numbers, (R,), from 0 on. Where none is repeated, all of the residuals may come back.
    """
    times = torch.bincount(order).to(residuals)
    if len(times) == len(order):
        return residuals.square().sum((0, 1))
    mean = residuals.new_zeros(len(times), *residuals.shape[1:]).index_add(0, order, residuals)
    mean = mean / times[:, None, None]
    apart = (residuals - mean[order]).square().sum((0, 1)) / (times - 1).sum()  # of a piece, by noise
    back = torch.einsum("n,nsj->j", times, mean.square()) - len(times) * apart
    return back.clamp_min(0)


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
