"""What a motion is worth: robot seconds until the model that it gives predicts the arm's tasks well."""

from sidegan.worth.contenders import MAKERS, make_set
from sidegan.worth.curves import Judge, Truth
from sidegan.worth.orders import SetOf
from sidegan.worth.score import Estimate, estimate, ratio, seconds_within
from sidegan.worth.settings import Contender, Legs, Regime, WorthSettings
from sidegan.worth.tasks import legs

__all__ = [
    "MAKERS",
    "Contender",
    "Estimate",
    "Judge",
    "Legs",
    "Regime",
    "SetOf",
    "Truth",
    "WorthSettings",
    "estimate",
    "legs",
    "make_set",
    "ratio",
    "seconds_within",
]
