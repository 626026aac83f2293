"""Prior knowledge of an arm's parameters, from its description."""

import torch
from torch import Tensor

from sidegan.identification.model import TorqueModel
from sidegan.robot import Arm, possible_links

POWERS = torch.tensor([0, 1, 1, 1, 2, 2, 2, 2, 2, 2], dtype=torch.float64)  # of length in link parameters
_LIGHT, _SMALL = 0.02, 0.05  # a link is taken for at least this share of the heaviest, and of 0.05 m


def scales(arm: Arm) -> tuple[Tensor, Tensor]:
    """Mass [kg] and length [m] that are typical of each link, (J,) each, from its description."""
    x = possible_links(arm)
    mass = x[:, 0].clamp_min(_LIGHT * float(x[:, 0].max()))
    gyration = ((x[:, 4] + x[:, 6] + x[:, 9]).clamp_min(0) / 2 / mass).sqrt()
    return mass, gyration.clamp_min(_SMALL)


def typical(arm: Arm) -> Tensor:
    """Size that is typical of each link parameter, (J, 10): m, m l and m l²."""
    mass, length = scales(arm)
    return mass[:, None] * length[:, None] ** POWERS


def belief(model: TorqueModel, scale: Tensor, share: float) -> Tensor:
    """Information (P, P) of a belief: parameters are right within a share of links' typical sizes.

    Terms are within that share of their joint's torque, (J,). Nothing is believed of rotors inside groupings.
    """
    rows = model.body.base.mapping * (share * typical(model.arm).reshape(-1))
    terms = (share * scale[model.extras % model.joints]) ** -2
    return torch.block_diag(torch.linalg.inv(rows @ rows.T), terms.diag())
