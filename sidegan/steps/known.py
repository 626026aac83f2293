"""Results of an earlier run of identify, for commands that go on from it."""

import re
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.storage import read_json
from sidegan.errors import ConfigError, SideganError
from sidegan.identification.model import Terms, TorqueModel
from sidegan.motion.dynamics import RigidBody
from sidegan.robot import Arm

_ROUNDED = 2e-3  # relative difference of numbers in two formulas that differ in rounding alone
_NUMBER = re.compile(r"\d+(?:\.\d+)?(?:e[+-]?\d+)?")
_TERMS = ("rotor_inertia", "viscous", "coulomb", "offset")


@dataclass(frozen=True, eq=False)
class Known:
    """An identified model, read back."""

    model: TorqueModel  # what torque is explained with
    covariance: Array  # of their errors, (P, P)
    certainty: Array  # one over the deviation of an independent sample's torque, (J,)
    rate: float  # of the samples [Hz]


def known_model(folder: Path, arm: Arm) -> Known:
    """The model that a run of identify left in its folder; a ConfigError for any other folder or arm."""
    from sidegan.report.identification import PARAMETERS  # and with it all that makes a report

    path = folder / PARAMETERS
    try:
        numbers = read_json(path)
        if numbers["joints"] != list(arm.joint_names):
            raise ConfigError(f"{path} is of an arm with joints {', '.join(numbers['joints'])}")
        kinds = {name: name in numbers["use"]["terms"] for name in _TERMS}
        model = TorqueModel(RigidBody(arm), Terms(**kinds, sign_width=numbers["sign_width"]))
        if not _alike(" ; ".join(model.formulas), " ; ".join(numbers["formulas"])):
            raise ConfigError(f"{path} is of another arm than {arm.name}: its links are placed otherwise")
        covariance, certainty = (np.array(numbers[name], float) for name in ("covariance", "certainty"))
        return Known(model, covariance, certainty, float(numbers["rate"]))
    except ConfigError:
        raise
    except (SideganError, KeyError, TypeError, ValueError, RuntimeError) as error:
        raise ConfigError(
            f"known is {str(folder)!r}, expected the folder of a run of +experiment=identify: {error}"
        ) from error


def _alike(one: str, other: str) -> bool:
    """Whether two formulas are the same but for the last digits of their numbers."""
    ours, theirs = ([float(x) for x in _NUMBER.findall(text)] for text in (one, other))
    alike = _NUMBER.sub("#", one) == _NUMBER.sub("#", other)
    return alike and bool(np.allclose(ours, theirs, rtol=_ROUNDED, atol=0))
