"""Identify an arm's model and its uncertainty from simulated or recorded measurements."""

from sidegan.identification.estimate import estimate, score
from sidegan.identification.measurements import Measurements, Noise, disturbed, measure
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
    "disturbed",
    "estimate",
    "measure",
    "score",
]
