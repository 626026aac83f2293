"""An arm in its cell: surroundings, effort, home position, and notes on defaults."""

from sidegan.cell.cell import Cell, coefficients_of, require_cell
from sidegan.cell.settings import TrajectoryFamily
from sidegan.cell.workspace import Cylinder, Mesh, Region, Workspace

__all__ = [
    "Cell",
    "Cylinder",
    "Mesh",
    "Region",
    "TrajectoryFamily",
    "Workspace",
    "coefficients_of",
    "require_cell",
]
