"""Trajectories as files for robot controllers: CSV, ROS 2, URScript."""

from sidegan.controllers.course import approach, slower
from sidegan.controllers.export import APPROACH, export_set, require_exportable
from sidegan.controllers.formats import SHELL
from sidegan.controllers.settings import ExportSettings

__all__ = [
    "APPROACH",
    "SHELL",
    "ExportSettings",
    "approach",
    "export_set",
    "require_exportable",
    "slower",
]
