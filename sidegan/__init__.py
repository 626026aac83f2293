"""Thousands of valid, diverse, exciting trajectories for robot dynamics identification.

    import sidegan as sg
    cell = sg.Cell("arm.urdf")                                          # what was decided: cell.notes
    excitation = sg.excite(cell, count=10, seed=0)                      # .motion(rate), .save(folder)
    arm = sg.identify(cell, ["a.csv", "b.csv"], validation=["c.csv"])   # .verdict, .torque(q, dq, ddq)
    generator = sg.train("eigen", cell, seeds=sg.seeds(cell, 400))      # .sample(1000)

Names are imported when they are first used.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from sidegan.cell import Cell, Workspace
    from sidegan.controllers import ExportSettings
    from sidegan.design.problem import SearchSettings
    from sidegan.errors import SideganError
    from sidegan.gan.settings import SurrogateSettings, Variant
    from sidegan.identification import EstimationSettings, GoalSettings, Terms
    from sidegan.recording.settings import RecordingSettings
    from sidegan.robot import Arm, built_in_robots, load_robot
    from sidegan.steps.excite import excite
    from sidegan.steps.identify import IdentifiedModel, check_recordings, identify
    from sidegan.steps.seeds import seeds
    from sidegan.steps.train import Generator, surrogates, train
    from sidegan.steps.trajectories import TrajectorySet

__version__ = "0.2.0"

__all__ = [
    "Arm",
    "Cell",
    "EstimationSettings",
    "ExportSettings",
    "Generator",
    "GoalSettings",
    "IdentifiedModel",
    "RecordingSettings",
    "SearchSettings",
    "SideganError",
    "SurrogateSettings",
    "Terms",
    "TrajectorySet",
    "Variant",
    "Workspace",
    "built_in_robots",
    "check_recordings",
    "excite",
    "identify",
    "load_robot",
    "seeds",
    "surrogates",
    "train",
]

_MODULES = {
    "cell": ("Cell", "Workspace"),
    "controllers": ("ExportSettings",),
    "design.problem": ("SearchSettings",),
    "errors": ("SideganError",),
    "gan.settings": ("SurrogateSettings", "Variant"),
    "identification": ("EstimationSettings", "GoalSettings", "Terms"),
    "recording.settings": ("RecordingSettings",),
    "robot": ("Arm", "built_in_robots", "load_robot"),
    "steps.excite": ("excite",),
    "steps.identify": ("IdentifiedModel", "check_recordings", "identify"),
    "steps.seeds": ("seeds",),
    "steps.train": ("Generator", "surrogates", "train"),
    "steps.trajectories": ("TrajectorySet",),
}
_HOMES = {name: module for module, names in _MODULES.items() for name in names}


def __getattr__(name: str) -> Any:
    if name not in _HOMES:
        raise AttributeError(f"module 'sidegan' has no attribute {name!r}")
    globals()[name] = value = getattr(import_module(f"sidegan.{_HOMES[name]}"), name)
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__})
