"""Prior knowledge of an arm's parameters, from its description."""

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.identification.model import TorqueModel
from sidegan.robot import Arm, possible_links

POWERS = np.array([0.0, 1, 1, 1, 2, 2, 2, 2, 2, 2])  # of length in link parameters
_LIGHT, _SMALL = 0.02, 0.05  # a link is taken for at least this share of the heaviest, and of 0.05 m


def scales(arm: Arm) -> tuple[Array, Array]:
    """Mass [kg] and length [m] that are typical of each link, (J,) each, from its description."""
    x = possible_links(arm)
    mass = np.maximum(x[:, 0], _LIGHT * x[:, 0].max())
    gyration = np.sqrt(np.maximum(x[:, 4] + x[:, 6] + x[:, 9], 0) / 2 / mass)
    return mass, np.maximum(gyration, _SMALL)


def typical(arm: Arm) -> Array:
    """Size that is typical of each link parameter, (J, 10): m, m l and m l²."""
    mass, length = scales(arm)
    return mass[:, None] * length[:, None] ** POWERS


def belief(model: TorqueModel, scale: Array) -> Array:
    """Information (P, P) of a belief: parameters are right within links' typical sizes.

    Terms are within their joint's torque, (J,). Nothing is believed of rotors inside groupings.
    """
    rows = model.body.base.mapping * typical(model.arm).ravel()
    terms = scale[model.extras % model.joints] ** -2.0
    return scipy.linalg.block_diag(np.linalg.inv(rows @ rows.T), np.diag(terms))
