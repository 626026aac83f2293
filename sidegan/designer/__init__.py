"""Trajectories designed within milliseconds: for any situation, and with what is known already."""

from sidegan.designer.aim import Aim
from sidegan.designer.designer import Design, Designer, Spent
from sidegan.designer.generator import Generator
from sidegan.designer.make import make_starts
from sidegan.designer.many import Compiled
from sidegan.designer.settings import DesignerSettings, GeneratorSettings, LibrarySettings
from sidegan.designer.situation import Situation
from sidegan.designer.starts import Starts
from sidegan.designer.training import make_generator

__all__ = [
    "Aim",
    "Compiled",
    "Design",
    "Designer",
    "DesignerSettings",
    "Generator",
    "GeneratorSettings",
    "LibrarySettings",
    "Situation",
    "Spent",
    "Starts",
    "make_generator",
    "make_starts",
]
