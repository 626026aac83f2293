"""Physical consistency of links: whether mass, centre of mass and inertia belong to a real body."""

import math

import numpy as np
from numpy.typing import ArrayLike

from sidegan.base.arrays import Array, numbers
from sidegan.base.names import listed
from sidegan.errors import RobotError, ShapeError
from sidegan.robot import thresholds
from sidegan.robot.arm import Arm, length_of

_ROUNDING = 1e-9  # of the largest principal moment: flat plates meet the triangle inequality with equality
# Root of the second moment along each axis, as a share of the mean distance between joints: of a default
# link, of a thin link when corrected, and the largest of a link that is too thin.
_PLAIN, _THIN, _TOO_THIN = 1 / 6, 1 / 30, 1 / 300
_DENSITY = 50.0  # [kg/m³] of a default link over the cube of that distance: water, a quarter as thick as long


def pseudo_inertia(parameters: Array) -> Array:
    """Pseudo-inertias [kg, kg·m, kg·m²], (…, 4, 4), of link parameters (…, 10) in Pinocchio's order.

    [[½ tr(I) 1 − I, h], [hᵀ, m]] with inertia I about the joint's frame and first moment h. It is positive
    definite exactly for physically consistent links: mass and inertia about the centre of mass are positive
    definite, and the principal moments meet the triangle inequality.

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
    """Links that are inconsistent, too light, or have mass or inertia far outside their size, and why."""
    mass, place, located = _masses(arm)
    radius, size, usual = _gyration(arm), _sizes(arm), float(np.median(mass))
    shaped = np.isin(np.arange(arm.joints), arm.capsules.link)
    most = np.where(shaped, thresholds.GYRATION_SHAPED, thresholds.GYRATION_UNSEEN)
    outside = radius > most * np.maximum(size, thresholds.SHORTEST_LINK * length_of(vars(arm)))
    light = (mass < thresholds.LIGHT_LINK * usual) & (mass < thresholds.DENSITY_OF_FOAM * size**3)
    found = dict[str, str]()
    for i, name in enumerate(arm.link_names):
        if not located[i]:
            found[name] = f"{mass[i]:.3g} kg at {place[i]:.3g} m from its joint"
        elif outside[i] and not _placeholders(arm)[i]:
            found[name] = f"radius of gyration {radius[i]:.3g} m in a link of {size[i]:.2g} m"
        elif light[i]:
            found[name] = f"{mass[i]:.3g} kg in a link of {size[i]:.2g} m, where {usual:.3g} kg is usual"
    return found | dict(inconsistent_links(arm))


def describe_other_units(arm: Arm) -> str:
    """A question on masses and inertias that no arm has, with converted values; empty if there are none."""
    links, reach, radius = arm.inertial_parameters, length_of(vars(arm)), _gyration(arm)
    whole = links[:, 0].sum()
    said = []
    if whole > max(thresholds.HEAVIEST_ARM, thresholds.DENSEST_ARM * reach**3):
        kilograms = [f"{name} {m:.4g}" for name, m in zip(arm.link_names, links[:, 0] / 1e3)]
        said.append(
            f"the links weigh {whole:.5g} kg and reach {reach:.2g} m: are these grams? In kg: "
            f"{listed(kilograms)}; look at inertias, too"
        )
    wrong = np.flatnonzero(radius > max(thresholds.GYRATION, thresholds.GYRATION_PER_REACH * reach))
    if wrong.size:
        inside = (_PLAIN * reach / 2 / np.median(radius[wrong])) ** 2
        unit, factor = min(thresholds.INERTIA_UNITS.items(), key=lambda one: abs(math.log(one[1] / inside)))
        moments = factor * about_the_centre(links[wrong])[1].diagonal(0, 1, 2)
        right = [f"{arm.link_names[i]} {radius[i]:.3g} m, {row.round(5)}" for i, row in zip(wrong, moments)]
        said.append(
            f"radii of gyration are far beyond the reach of {reach:.2g} m: are inertias in {unit}? Radii, "
            f"and then ixx, iyy, izz in kg·m²: {listed(right)}"
        )
    return f"{arm.name}: {'; '.join(said)}" if said else ""


def describe_doubtful_links(arm: Arm) -> str:
    """A sentence on the doubtful links of an arm; empty if there are none."""
    reasons: dict[str, list[str]] = {}
    for name, reason in doubtful_links(arm).items():
        reasons.setdefault(reason, []).append(name)
    links = "; ".join(f"{listed(names)} ({reason})" for reason, names in reasons.items())
    return f"links of {arm.name} that cannot be as described: {links}" if links else ""


def possible_links(arm: Arm) -> Array:
    """Physically consistent link parameters, (J, 10), nearest to the description's.

    Too small second moments about the centre of mass are raised. A link whose mass or centre of mass cannot
    be, or is a placeholder, becomes a default link half-way to the next joint, with the others' median mass.
    """
    links = arm.inertial_parameters.copy()
    length = _length(arm)
    known = _masses(arm)[2] & ~_placeholders(arm)
    usual = np.median(links[known, 0]) if known.any() else _DENSITY * length**3
    plain = (_PLAIN * length) ** 2 * np.eye(3)
    for i, ahead in enumerate([*arm.translation[1:], arm.tip]):
        links[i] = _thickened(links[i], length) if known[i] else usual * _unit_link(ahead / 2, plain)
    return links


def _length(arm: Arm) -> float:
    """Mean distance between joints [m]; 1 if it is zero."""
    return float(np.linalg.norm(np.concatenate([arm.translation[1:], arm.tip[None]]), axis=1).mean()) or 1.0


def _masses(arm: Arm) -> tuple[Array, Array, Array]:
    """Masses of links [kg], distances of their centres from the joints [m], and whether both can be, (J,)."""
    links = arm.inertial_parameters
    mass = links[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):  # masses may be zero
        place = np.linalg.norm(links[:, 1:4], axis=1) / mass
    heavy = (mass > 0) & (mass > thresholds.NEXT_TO_NOTHING * mass.max())
    near = place < thresholds.FARTHEST_CENTRE * _length(arm)
    return mass, place, heavy & near & np.isfinite(links).all(1)


def _gyration(arm: Arm) -> Array:
    """Largest radii of gyration of the links about their centres of mass [m], (J,); 0 without mass."""
    links = arm.inertial_parameters
    with np.errstate(divide="ignore", invalid="ignore"):  # masses may be zero
        square = about_the_centre(links)[1].trace(0, 1, 2) / 2 / links[:, 0]
    return np.sqrt(np.nan_to_num(np.maximum(square, 0.0), posinf=0.0))


def _sizes(arm: Arm) -> Array:
    """Distances of the links' centres of mass from their farthest joint or point of a shape [m], (J,)."""
    centre = arm.inertial_parameters[:, 1:4] / np.maximum(arm.inertial_parameters[:, :1], 1e-9)
    ends = np.concatenate([arm.translation[1:], arm.tip[None]])
    found = np.maximum(np.linalg.norm(centre, axis=1), np.linalg.norm(ends - centre, axis=1))
    shapes, moving = arm.capsules, arm.capsules.link >= 0
    link = shapes.link[moving]
    for end in (shapes.a[moving], shapes.b[moving]):
        np.maximum.at(found, link, np.linalg.norm(end - centre[link], axis=1) + shapes.radius[moving])
    return found


def placeholder_links(arm: Arm) -> list[str]:
    """Links whose masses and inertias are made up: equal, and centred at their joints, in most links."""
    return [name for name, marked in zip(arm.link_names, _placeholders(arm).tolist()) if marked]


def describe_placeholder_links(arm: Arm) -> str:
    """A phrase on the placeholder links of an arm; empty if there are none."""
    alike = "equal masses and inertias, centres of mass at the joints"
    links = placeholder_links(arm)
    return f"masses of {listed(links)} are placeholders ({alike})" if links else ""


def _placeholders(arm: Arm) -> Array:
    """Which links are placeholders, (J,) bool."""
    links = arm.inertial_parameters
    heavy = links[:, 0] > 0
    off = np.linalg.norm(links[:, 1:4], axis=1)  # first moments
    centred = heavy & (off <= thresholds.CENTRED * _length(arm) * links[:, 0])
    equal = np.isclose(links[:, None], links[None], rtol=thresholds.ALIKE_LINKS, atol=0.0)
    alike = equal[..., [0, 4, 6, 9]].all(2) & centred & centred[:, None]
    most = alike[alike.sum(1).argmax()]
    enough = int(most.sum()) >= max(thresholds.PLACEHOLDERS, int(heavy.sum()) // 2 + 1)
    return most if enough else np.zeros_like(heavy)


def _thickened(link: Array, length: float) -> Array:
    """A link (10,), with its second moments about the centre of mass raised if it is too thin."""
    centre, inertia = about_the_centre(link)
    spread = (inertia.trace() / 2 * np.eye(3) - inertia) / link[0]
    values, axes = np.linalg.eigh(spread)
    if values[0] > (_TOO_THIN * length) ** 2:
        return link
    return link[0] * _unit_link(centre, (axes * np.maximum(values, (_THIN * length) ** 2)) @ axes.T)


def _unit_link(centre: Array, spread: Array) -> Array:
    """Parameters of a link of 1 kg, (10,), with a centre [m], (3,), and second moments there [m²], (3, 3)."""
    place = np.append(centre, 1.0)
    whole = np.outer(place, place)
    whole[:3, :3] += spread
    return FROM_PSEUDO_INERTIA @ whole.ravel()


def inconsistent_links(arm: Arm, parameters: ArrayLike | None = None) -> list[tuple[str, str]]:
    """Physically inconsistent links, each with the reason.

    A link includes everything fixed to it. ``parameters``, the arm's by default, are about the joints'
    frames in Pinocchio's order, (J, 10).

    Raises:
        ShapeError: when the parameters do not fit the arm.
    """
    links = arm.inertial_parameters if parameters is None else numbers(parameters, "parameters")
    if links.shape != (arm.joints, 10):
        raise ShapeError(f"inertial parameters are {links.shape}, expected ({arm.joints}, 10)")
    return [(name, reason) for name, link in zip(arm.link_names, links) if (reason := _reason(link))]


def require_consistent(arm: Arm, parameters: ArrayLike | None = None) -> None:
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
