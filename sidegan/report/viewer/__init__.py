"""A page on which an arm moves along trajectories: one HTML file that needs nothing else."""

from sidegan.report.viewer.content import View, view_of
from sidegan.report.viewer.page import write_view

__all__ = ["View", "view_of", "write_view"]
