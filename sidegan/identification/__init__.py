"""Measurements, simulated or recorded, to an identified model with its uncertainty."""

from sidegan.identification.identify import evaluate, identify, identify_weighted
from sidegan.identification.measurements import Measurements, Noise, measure
from sidegan.identification.metrics import covariance_norm, nmse
from sidegan.identification.rls import Identified, Rls

__all__ = [
    "Identified",
    "Measurements",
    "Noise",
    "Rls",
    "covariance_norm",
    "evaluate",
    "identify",
    "identify_weighted",
    "measure",
    "nmse",
]
