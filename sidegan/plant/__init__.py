"""The arm in MuJoCo under position servos, which may be recorded as a real one is."""

from sidegan.plant.execute import Executed, Plant, save_recording
from sidegan.plant.model import mujoco_model
from sidegan.plant.settings import IDEAL, PlantSettings

__all__ = ["IDEAL", "Executed", "Plant", "PlantSettings", "mujoco_model", "save_recording"]
