"""Which links could exist: mass, centre of mass and inertia that some distribution of mass has."""

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import listed
from sidegan.errors import RobotError, ShapeError
from sidegan.robot.arm import Arm

_ROUNDING = 1e-9  # of the largest principal moment: a flat plate may meet the triangle inequality exactly
# Shares of the mean distance between joints: no link's centre of mass is farther from its joint; radii of
# gyration along an axis of a plain link, of the nearest to one that is too thin, and of what is too thin.
_FARTHEST, _PLAIN, _THIN, _TOO_THIN = 10.0, 1 / 6, 1 / 30, 1 / 300
_DENSITY = 50.0  # [kg/m³] of a plain link in the cube of that distance: water, a quarter as thick as long
_CENTRED = 1e-3  # share of that distance between a joint and a mass in it
_ALIKE = 1e-6  # share by which numbers differ that are equal
_FEWEST = 3  # links that are alike by no chance
_NEXT_TO_NOTHING = 1e-5  # of the heaviest link's mass


def pseudo_inertia(parameters: Array) -> Array:
    """Pseudo-inertias [kg, kg·m, kg·m²], (…, 4, 4), of link parameters (…, 10) in Pinocchio's order.

    [[½ tr(I) 1 − I, h], [hᵀ, m]] with inertia I about the joint's frame and first moment h. It is positive
    definite exactly when mass and inertia about the centre of mass are, and the principal moments meet the
    triangle inequality: for a real link.

    Source: Wensing, Kim, Slotine 2018, Linear matrix inequalities for physically consistent inertial
    parameter identification, eq. 13.
    """
    m, x, y, z, xx, xy, yy, xz, yz, zz = np.moveaxis(parameters, -1, 0)
    half = (xx + yy + zz) / 2
    rows = [half - xx, -xy, -xz, x, -xy, half - yy, -yz, y, -xz, -yz, half - zz, z, x, y, z, m]
    return np.stack(rows, -1).reshape(*parameters.shape[:-1], 4, 4)


# The linear map from a flattened pseudo-inertia back to link parameters, (10, 16).
FROM_PSEUDO_INERTIA = np.linalg.pinv(pseudo_inertia(np.eye(10)).reshape(10, 16).T)


def inertia_matrices(parameters: Array) -> Array:
    """Inertia about the joint's frame [kg·m²], (…, 3, 3), of parameters (…, 10)."""
    xx, xy, yy, xz, yz, zz = np.moveaxis(parameters[..., 4:], -1, 0)
    rows = [xx, xy, xz, xy, yy, yz, xz, yz, zz]
    return np.stack(rows, -1).reshape(*parameters.shape[:-1], 3, 3)


def about_the_centre(parameters: Array) -> tuple[Array, Array]:
    """Centre of mass [m], (…, 3), and inertia about it [kg·m²], (…, 3, 3); the masses must not be zero."""
    first = parameters[..., 1:4]
    centre = first / parameters[..., :1]
    square = (first * centre).sum(-1)[..., None, None] * np.eye(3)
    return centre, inertia_matrices(parameters) - square + first[..., :, None] * centre[..., None, :]


def doubtful_links(arm: Arm) -> dict[str, str]:
    """Links that cannot be as they are described, each with the reason.

    They are not physically consistent, weigh next to nothing, or have their mass far from any link.
    """
    mass, place, located = _masses(arm)
    each = zip(arm.link_names, mass.tolist(), place.tolist(), located)
    found = {name: f"{m:.3g} kg at {x:.3g} m from its joint" for name, m, x, known in each if not known}
    return found | dict(inconsistent_links(arm))


def describe_doubtful_links(arm: Arm) -> str:
    """Which links of an arm cannot be as they are described, and why; empty where all can."""
    reasons: dict[str, list[str]] = {}
    for name, reason in doubtful_links(arm).items():
        reasons.setdefault(reason, []).append(name)
    said = "; ".join(f"{listed(names)} ({reason})" for reason, names in reasons.items())
    return f"links of {arm.name} that are physically impossible as described: {said}" if said else ""


def possible_links(arm: Arm) -> Array:
    """Link parameters that can be, (J, 10), nearest to the description's: its own where those can be.

    Second moments of a link become the nearest possible about its centre of mass. A link whose mass is not
    known, or not where, becomes a plain one half-way to the next joint, as heavy as the others usually are.
    """
    links, length = arm.inertial_parameters.copy(), _length(arm)
    known = _masses(arm)[2] & ~_placeholders(arm)
    usual = np.median(links[known, 0]) if known.any() else _DENSITY * length**3
    plain = (_PLAIN * length) ** 2 * np.eye(3)
    for i, ahead in enumerate([*arm.translation[1:], arm.tip]):
        links[i] = _thickened(links[i], length) if known[i] else usual * _unit_link(ahead / 2, plain)
    return links


def _length(arm: Arm) -> float:
    """Mean distance between joints [m]; 1 where there is none."""
    return float(np.linalg.norm(np.concatenate([arm.translation[1:], arm.tip[None]]), axis=1).mean()) or 1.0


def _masses(arm: Arm) -> tuple[Array, Array, Array]:
    """Masses of the links [kg], how far out they are [m], and whether they can be there, (J,) each."""
    links = arm.inertial_parameters
    mass = links[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):  # a link may weigh nothing
        place = np.linalg.norm(links[:, 1:4], axis=1) / mass
    heavy = (mass > 0) & (mass > _NEXT_TO_NOTHING * mass.max())
    return mass, place, heavy & (place < _FARTHEST * _length(arm)) & np.isfinite(links).all(1)


def placeholder_links(arm: Arm) -> list[str]:
    """Links of one mass and one inertia, centred in their joints, if these are most: nobody measured that."""
    return [name for name, marked in zip(arm.link_names, _placeholders(arm).tolist()) if marked]


def describe_placeholder_links(arm: Arm) -> str:
    """Which links of an arm are placeholders; empty where none are."""
    alike = "equal masses and inertias, centres of mass at the joints"
    links = placeholder_links(arm)
    return f"masses of {listed(links)} are placeholders ({alike})" if links else ""


def _placeholders(arm: Arm) -> Array:
    """Which links are placeholders, (J,) bool."""
    links = arm.inertial_parameters
    heavy = links[:, 0] > 0
    centred = heavy & (np.linalg.norm(links[:, 1:4], axis=1) <= _CENTRED * _length(arm) * links[:, 0])
    alike = np.isclose(links[:, None], links[None], rtol=_ALIKE, atol=0.0)[..., [0, 4, 6, 9]].all(2)
    alike = alike & centred & centred[:, None]
    most = alike[alike.sum(1).argmax()]
    enough = int(most.sum()) >= max(_FEWEST, int(heavy.sum()) // 2 + 1)
    return most if enough else np.zeros_like(heavy)


def _thickened(link: Array, length: float) -> Array:
    """A link (10,); with the nearest second moments about its centre where it is too thin."""
    centre, inertia = about_the_centre(link)
    spread = (inertia.trace() / 2 * np.eye(3) - inertia) / link[0]
    values, axes = np.linalg.eigh(spread)
    if values[0] > (_TOO_THIN * length) ** 2:
        return link
    return link[0] * _unit_link(centre, (axes * np.maximum(values, (_THIN * length) ** 2)) @ axes.T)


def _unit_link(centre: Array, spread: Array) -> Array:
    """Parameters of 1 kg, (10,), about a centre [m], (3,), with second moments (3, 3) there [m²]."""
    place = np.append(centre, 1.0)
    whole = np.outer(place, place)
    whole[:3, :3] += spread
    return FROM_PSEUDO_INERTIA @ whole.ravel()


def inconsistent_links(arm: Arm, parameters: Array | None = None) -> list[tuple[str, str]]:
    """Links that cannot exist, each with the reason; an empty list when all are physically consistent.

    A link is what one joint moves, with everything that is fixed to it. Parameters to judge instead of the
    arm's own are about the joints' frames in Pinocchio's order, (J, 10).

    Raises:
        ShapeError: when the parameters do not fit the arm.
    """
    links = arm.inertial_parameters if parameters is None else parameters
    if links.shape != (arm.joints, 10):
        raise ShapeError(f"inertial parameters are {links.shape}, expected ({arm.joints}, 10)")
    return [(name, reason) for name, link in zip(arm.link_names, links) if (reason := _reason(link))]


def require_consistent(arm: Arm, parameters: Array | None = None) -> None:
    """Raise unless every link is physically consistent; arguments as of ``inconsistent_links``.

    Raises:
        RobotError: with every link that is not, and why.
        ShapeError: when the parameters do not fit the arm.
    """
    wrong = inconsistent_links(arm, parameters)
    if wrong:
        links = "; ".join(f"link {name!r}: {reason}" for name, reason in wrong)
        raise RobotError(f"{arm.name} is not physically consistent: {links}")


def _reason(parameters: Array) -> str:
    """Why a link (10,) cannot exist; empty when it can."""
    if not np.isfinite(parameters).all():
        return "a parameter is not finite"
    mass = float(parameters[0])
    if not mass > 0:
        return f"its mass is {mass:.4g} kg, expected more than 0"
    centre, inertia = about_the_centre(parameters)
    low, middle, high = np.linalg.eigvalsh(inertia).tolist()
    moments = f"principal moments {low:.4g}, {middle:.4g}, {high:.4g} kg·m² about the centre of mass"
    if not low > 0:
        if np.linalg.eigvalsh(inertia_matrices(parameters))[0] > 0:
            place = ", ".join(f"{x:.4g}" for x in centre.tolist())
            return f"its centre of mass ({place}) m is too far out for its inertia: {moments}"
        return f"{moments}, expected more than 0"
    if high - low - middle > _ROUNDING * high:
        return f"{moments}: the largest exceeds the sum of the others"
    return ""
