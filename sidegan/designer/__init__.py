"""One search for one proven trajectory: compiled descents from many starts, then the proof."""

from sidegan.designer.aim import Aim, noise_at
from sidegan.designer.designer import Design, Designer, Spent
from sidegan.designer.many import Compiled
from sidegan.designer.settings import DesignerSettings
from sidegan.designer.situation import Situation

__all__ = ["Aim", "Compiled", "Design", "Designer", "DesignerSettings", "Situation", "Spent", "noise_at"]
