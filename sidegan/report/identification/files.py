"""What each written file predicts, computed with what it holds."""

import runpy
from functools import partial
from pathlib import Path

import numpy as np

from sidegan.identification.estimate import Score
from sidegan.identification.identified import IdentifiedArm
from sidegan.recording.grid import low_pass
from sidegan.recording.recording import Segment
from sidegan.robot import torque_of_mjcf, torque_of_urdf

_SAMPLES = 100_000  # that all stretches have together, each cut to its beginning: a few seconds of work


def file_errors(identified: IdentifiedArm, urdf: Path, mjcf: Path, source: Path) -> dict[str, Score]:
    """Errors of the URDF, the MJCF and the Python class in ``source``, by the names of these files.

    On the validation data, or on the training data if there is none. Predicted torques are low-passed like
    the measured ones, in which friction does not jump.
    """
    arm = identified.model.arm
    readers = {
        urdf.name: partial(torque_of_urdf, urdf, arm),
        mjcf.name: partial(torque_of_mjcf, mjcf),
        source.name: runpy.run_path(str(source))["ArmDynamics"](source.parent).torque,
    }
    each = [(x.grid, part) for x in identified.validation or identified.training for part in x.segments]
    most = -(-_SAMPLES // len(each))
    parts = [(grid, Segment(*(signal[:most] for signal in part))) for grid, part in each]
    torque = np.concatenate([part.torque for _, part in parts])
    variance = torque.var(0)
    found = {}
    for name, read in readers.items():
        predicted = [low_pass(read(*part[1:4]), grid.cutoff, 1 / grid.rate) for grid, part in parts]
        squares = np.square(torque - np.concatenate(predicted)).mean(0)
        nmse = np.divide(squares, variance, out=np.full_like(squares, np.inf), where=variance > 0)
        found[name] = Score(nmse, np.sqrt(squares))
    return found
