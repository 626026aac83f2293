"""Trajectories designed within milliseconds: for any situation, and with what is known already."""

from sidegan.designer.aim import Aim, noise_at
from sidegan.designer.designer import Design, Designer, Spent
from sidegan.designer.generator import Generator
from sidegan.designer.make import make_starts
from sidegan.designer.many import Compiled
from sidegan.designer.sets import begin_designed, one_by_one, variance_of
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
    "begin_designed",
    "make_generator",
    "make_starts",
    "noise_at",
    "one_by_one",
    "variance_of",
]
