"""Identify an arm's model and its uncertainty from simulated or recorded measurements."""

from sidegan.identification.estimate import estimate, score
from sidegan.identification.measurements import Measurements, Noise, add_noise, exact_measurements
from sidegan.identification.model import FULL, RIGID, Terms, TorqueModel
from sidegan.identification.settings import (
    EstimationSettings,
    GoalSettings,
    KnownLoad,
    ReplicationSettings,
    StudySettings,
)

__all__ = [
    "FULL",
    "RIGID",
    "EstimationSettings",
    "GoalSettings",
    "KnownLoad",
    "Measurements",
    "Noise",
    "ReplicationSettings",
    "StudySettings",
    "Terms",
    "TorqueModel",
    "add_noise",
    "estimate",
    "exact_measurements",
    "score",
]
