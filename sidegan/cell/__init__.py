"""An arm in its cell: what is around it, how hard it may work, where it rests, and what was decided."""

from sidegan.cell.cell import Cell, TrajectoryFamily
from sidegan.cell.workspace import Cylinder, Mesh, Region, Workspace

__all__ = ["Cell", "Cylinder", "Mesh", "Region", "TrajectoryFamily", "Workspace"]
