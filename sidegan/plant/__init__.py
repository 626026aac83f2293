"""Simulated arm in MuJoCo under position servos, recorded like a real one."""

from sidegan.plant.execute import Executed, Plant, save_recording
from sidegan.plant.model import IDEAL, PlantSettings, mujoco_model

__all__ = ["IDEAL", "Executed", "Plant", "PlantSettings", "mujoco_model", "save_recording"]
