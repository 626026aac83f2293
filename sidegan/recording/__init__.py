"""Recordings of a real arm: read, checked, and conditioned for identification."""

from sidegan.recording.check import Findings, check_recording, examine
from sidegan.recording.columns import Columns, Units
from sidegan.recording.conditioning import condition, grid_for
from sidegan.recording.load import Source, load_recording
from sidegan.recording.raw import Survey, survey
from sidegan.recording.recording import Recording, Segment
from sidegan.recording.settings import Grid, Settings

__all__ = [
    "Columns",
    "Findings",
    "Grid",
    "Recording",
    "Segment",
    "Settings",
    "Source",
    "Survey",
    "Units",
    "check_recording",
    "condition",
    "examine",
    "grid_for",
    "load_recording",
    "survey",
]
