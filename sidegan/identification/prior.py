"""Prior knowledge of an arm's parameters, from its description."""

import numpy as np
import scipy  # its parts are imported when they are used

from sidegan.base.arrays import Array
from sidegan.identification.model import TorqueModel
from sidegan.robot import Arm, possible_links

POWERS = np.array([0.0, 1, 1, 1, 2, 2, 2, 2, 2, 2])  # of length in each link parameter
_LIGHT, _SMALL = 0.02, 0.05  # least typical mass, as a share of the heaviest link's, and length [m]


def scales(arm: Arm) -> tuple[Array, Array]:
    """Typical mass [kg] and length [m] of each link, (J,) each, from the description."""
    x = possible_links(arm)
    mass = np.maximum(x[:, 0], _LIGHT * x[:, 0].max())
    gyration = np.sqrt(np.maximum(x[:, 4] + x[:, 6] + x[:, 9], 0) / 2 / mass)
    return mass, np.maximum(gyration, _SMALL)


def typical(arm: Arm) -> Array:
    """Typical size of each link parameter, (J, 10): m, m l and m l²."""
    mass, length = scales(arm)
    return mass[:, None] * length[:, None] ** POWERS


def belief(model: TorqueModel, scale: Array) -> Array:
    """Prior information (P, P): base parameters are described to within the links' typical sizes.

    The deviation of terms is ``scale``, their joint's torque, (J,). Grouped rotor inertias have no prior.
    """
    rows = model.body.base.mapping * typical(model.arm).ravel()
    terms = scale[model.extras % model.joints] ** -2.0
    return scipy.linalg.block_diag(np.linalg.inv(rows @ rows.T), np.diag(terms))
