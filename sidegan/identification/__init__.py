"""Measurements, simulated or recorded, to an identified model with its uncertainty."""

from sidegan.identification.consistent import Conditions, Consistent, consistent
from sidegan.identification.estimate import METHODS, Estimate, estimate
from sidegan.identification.gains import Gains, drive_gains
from sidegan.identification.identify import evaluate, identify, identify_weighted
from sidegan.identification.live import Live
from sidegan.identification.measurements import Measurements, Noise, measure
from sidegan.identification.metrics import covariance_norm, nmse
from sidegan.identification.model import Model
from sidegan.identification.next_runs import NextRuns, grams_of, most_informative
from sidegan.identification.payload import Payload, identify_payload
from sidegan.identification.rls import Identified, Rls
from sidegan.identification.score import Folds, Score, folds, score
from sidegan.identification.stribeck import stribeck_velocities
from sidegan.identification.terms import Terms
from sidegan.identification.trust import Trust, trust
from sidegan.identification.verdict import Limits

__all__ = [
    "METHODS",
    "Conditions",
    "Consistent",
    "Estimate",
    "Folds",
    "Gains",
    "Identified",
    "Limits",
    "Live",
    "Measurements",
    "Model",
    "NextRuns",
    "Noise",
    "Payload",
    "Rls",
    "Score",
    "Terms",
    "Trust",
    "consistent",
    "covariance_norm",
    "drive_gains",
    "estimate",
    "evaluate",
    "folds",
    "grams_of",
    "identify",
    "identify_payload",
    "identify_weighted",
    "measure",
    "most_informative",
    "nmse",
    "score",
    "stribeck_velocities",
    "trust",
]
