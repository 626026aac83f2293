"""Link parameters as pseudo-inertias: a rigid body exists where that 4 × 4 matrix is positive definite."""

import torch
from torch import Tensor


def pseudo_inertia(links: Tensor) -> Tensor:
    """Pseudo-inertias (…, 4, 4) of link parameters (…, 10) in Pinocchio's order.

    [[½ tr(I) 1 − I, h], [hᵀ, m]] with h the first moment and I about the link's frame. It is positive
    definite exactly when mass and inertia about the centre of mass are, and the principal moments meet the
    triangle inequality.

    Source: Wensing, Kim, Slotine 2018, Linear matrix inequalities for physically consistent inertial
    parameter identification, eq. 13.
    """
    m, x, y, z, xx, xy, yy, xz, yz, zz = links.unbind(-1)
    half = (xx + yy + zz) / 2
    rows = [half - xx, -xy, -xz, x, -xy, half - yy, -yz, y, -xz, -yz, half - zz, z, x, y, z, m]
    return torch.stack(rows, -1).reshape(*links.shape[:-1], 4, 4)


def from_pseudo_inertia(pseudo: Tensor) -> Tensor:
    """Link parameters (…, 10) in Pinocchio's order of pseudo-inertias (…, 4, 4)."""
    flat = pseudo.reshape(*pseudo.shape[:-2], 16)
    return flat @ BACK.T.to(flat)


def _back() -> Tensor:
    """The linear map from a flattened pseudo-inertia to link parameters, (10, 16)."""
    forth = pseudo_inertia(torch.eye(10, dtype=torch.float64)).reshape(10, 16).T
    return torch.linalg.pinv(forth)


BACK = _back()


def least_eigenvalues(links: Tensor, mass: Tensor, length: Tensor) -> Tensor:
    """Smallest eigenvalue of each link's pseudo-inertia in units of a mass and a length, (J,)."""
    return torch.linalg.eigvalsh(scaled(pseudo_inertia(links), mass, length))[:, 0]


def scaled(pseudo: Tensor, mass: Tensor, length: Tensor) -> Tensor:
    """Pseudo-inertias (J, 4, 4) in units of masses and lengths (J,): D⁻¹ P D⁻¹."""
    unit = 1 / units(mass, length)
    return pseudo * unit[:, :, None] * unit[:, None]


def units(mass: Tensor, length: Tensor) -> Tensor:
    """Diagonal of D, (J, 4): √m (l, l, l, 1)."""
    one = torch.ones_like(length)
    return mass.sqrt()[:, None] * torch.stack([length, length, length, one], 1)
