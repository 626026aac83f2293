"""Which links could exist: mass, centre of mass and inertia that some distribution of mass has."""

import torch
from torch import Tensor

from sidegan.errors import RobotError, ShapeError
from sidegan.robot.arm import Arm

_ROUNDING = 1e-9  # of the largest principal moment: a flat plate may meet the triangle inequality exactly


def pseudo_inertia(parameters: Tensor) -> Tensor:
    """Pseudo-inertias [kg, kg·m, kg·m²], (…, 4, 4), of link parameters (…, 10) in Pinocchio's order.

    [[½ tr(I) 1 − I, h], [hᵀ, m]] with inertia I about the joint's frame and first moment h. It is positive
    definite exactly when mass and inertia about the centre of mass are, and the principal moments meet the
    triangle inequality: for a real link.

    Source: Wensing, Kim, Slotine 2018, Linear matrix inequalities for physically consistent inertial
    parameter identification, eq. 13.
    """
    m, x, y, z, xx, xy, yy, xz, yz, zz = parameters.unbind(-1)
    half = (xx + yy + zz) / 2
    rows = [half - xx, -xy, -xz, x, -xy, half - yy, -yz, y, -xz, -yz, half - zz, z, x, y, z, m]
    return torch.stack(rows, -1).reshape(*parameters.shape[:-1], 4, 4)


# The linear map from a flattened pseudo-inertia back to link parameters, (10, 16).
FROM_PSEUDO_INERTIA = torch.linalg.pinv(pseudo_inertia(torch.eye(10, dtype=torch.float64)).reshape(10, 16).T)


def inertia_matrices(parameters: Tensor) -> Tensor:
    """Inertia about the joint's frame [kg·m²], (J, 3, 3), of parameters (J, 10)."""
    xx, xy, yy, xz, yz, zz = parameters[:, 4:].unbind(1)
    return torch.stack([xx, xy, xz, xy, yy, yz, xz, yz, zz], 1).reshape(-1, 3, 3)


def about_the_centre(parameters: Tensor) -> tuple[Tensor, Tensor]:
    """Centre of mass [m], (J, 3), and inertia about it [kg·m²], (J, 3, 3); the masses must not be zero."""
    mass, first = parameters[:, :1], parameters[:, 1:4]
    centre = first / mass
    square = (first * centre).sum(1)[:, None, None] * torch.eye(3, dtype=parameters.dtype)
    return centre, inertia_matrices(parameters) - square + first[:, :, None] * centre[:, None, :]


def inconsistent_links(arm: Arm, parameters: Tensor | None = None) -> list[tuple[str, str]]:
    """Links that cannot exist, each with the reason; an empty list when all are physically consistent.

    A link is what one joint moves, with everything that is fixed to it.

    Args:
        arm: the arm.
        parameters: to judge instead of the arm's own, about the joints' frames in Pinocchio's order, (J, 10).

    Raises:
        ShapeError: when the parameters do not fit the arm.
    """
    links = arm.inertial_parameters if parameters is None else parameters
    if links.shape != (arm.joints, 10):
        raise ShapeError(f"inertial parameters are {tuple(links.shape)}, expected ({arm.joints}, 10)")
    reasons = [_reason(link[None]) for link in links.detach().double().cpu()]
    return [(name, reason) for name, reason in zip(arm.link_names, reasons) if reason]


def require_consistent(arm: Arm, parameters: Tensor | None = None) -> None:
    """Raise unless every link is physically consistent; arguments as of ``inconsistent_links``.

    Raises:
        RobotError: with every link that is not, and why.
        ShapeError: when the parameters do not fit the arm.
    """
    wrong = inconsistent_links(arm, parameters)
    if wrong:
        links = "; ".join(f"link {name!r}: {reason}" for name, reason in wrong)
        raise RobotError(f"{arm.name} is not physically consistent: {links}")


def _reason(parameters: Tensor) -> str:
    """Why a link (1, 10) cannot exist; empty when it can."""
    if not parameters.isfinite().all():
        return "a parameter is not finite"
    mass = float(parameters[0, 0])
    if not mass > 0:
        return f"its mass is {mass:.4g} kg, expected more than 0"
    centre, inertia = (x[0] for x in about_the_centre(parameters))
    low, middle, high = torch.linalg.eigvalsh(inertia).tolist()
    moments = f"principal moments {low:.4g}, {middle:.4g}, {high:.4g} kg·m² about the centre of mass"
    if not low > 0:
        about_joint = torch.linalg.eigvalsh(inertia_matrices(parameters)[0])
        if about_joint[0] > 0:
            place = ", ".join(f"{x:.4g}" for x in centre.tolist())
            return f"its centre of mass ({place}) m is too far out for its inertia: {moments}"
        return f"{moments}, expected more than 0"
    if high - low - middle > _ROUNDING * high:
        return f"{moments}: the largest exceeds the sum of the others"
    return ""
