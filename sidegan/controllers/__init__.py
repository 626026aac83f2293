"""Trajectories as files for robot controllers: CSV, ROS 2, URScript."""

from sidegan.controllers.course import approach, slower
from sidegan.controllers.export import APPROACH, ExportSettings, export_set, require_exportable
from sidegan.controllers.formats import SHELL

__all__ = [
    "APPROACH",
    "SHELL",
    "ExportSettings",
    "approach",
    "export_set",
    "require_exportable",
    "slower",
]
