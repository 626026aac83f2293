"""Trajectories designed within milliseconds: for any situation, and with what is known already."""

from sidegan.designer.designer import Design, Designer, Spent
from sidegan.designer.make import make_starts
from sidegan.designer.many import Compiled
from sidegan.designer.settings import DesignerSettings, LibrarySettings
from sidegan.designer.situation import Aim, Situation
from sidegan.designer.starts import Starts

__all__ = [
    "Aim",
    "Compiled",
    "Design",
    "Designer",
    "DesignerSettings",
    "LibrarySettings",
    "Situation",
    "Spent",
    "Starts",
    "make_starts",
]
