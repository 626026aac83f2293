"""Measurements, simulated or recorded, to an identified model with its uncertainty."""

from sidegan.identification.estimate import METHODS, Estimate, estimate
from sidegan.identification.measurements import Measurements, Noise, measure
from sidegan.identification.model import TorqueModel
from sidegan.identification.next_runs import NextRuns, grams_of, most_informative
from sidegan.identification.score import Score, folds, score
from sidegan.identification.settings import EstimationSettings, ReplicationSettings, StudySettings
from sidegan.identification.stribeck import stribeck_velocities
from sidegan.identification.terms import FULL, RIGID, Terms
from sidegan.identification.trust import trust
from sidegan.identification.verdict import Trust

__all__ = [
    "FULL",
    "METHODS",
    "RIGID",
    "Estimate",
    "EstimationSettings",
    "Measurements",
    "NextRuns",
    "Noise",
    "ReplicationSettings",
    "Score",
    "StudySettings",
    "Terms",
    "TorqueModel",
    "Trust",
    "estimate",
    "folds",
    "grams_of",
    "measure",
    "most_informative",
    "score",
    "stribeck_velocities",
    "trust",
]
