"""An arm's kinematics and inertias, parsed by Pinocchio from a checked description."""

import logging
import os
import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from typing import BinaryIO

import numpy as np
import pinocchio as pin

from sidegan.base.arrays import Array
from sidegan.base.names import counted
from sidegan.errors import RobotError
from sidegan.robot.description import Description

_log = logging.getLogger(__name__)


def pinocchio_model(description: Description) -> pin.Model:
    """Pinocchio's model of a serial chain."""
    with pinocchio_errors(description):
        model = pin.buildModelFromXML(description.xml)
    model.gravity.linear = np.array([0.0, 0.0, -description.gravity])
    return model


def kinematics_and_inertias(model: pin.Model, tip: str | None = None) -> dict[str, Array]:
    """Types, placements, axes and inertias of the joints, the tip and gravity, named as in `Arm`."""
    joints = range(1, model.njoints)
    data = model.createData()
    pin.forwardKinematics(model, data, pin.neutral(model))
    # linear and angular velocity at unit joint velocity
    subspaces = np.array([np.ravel(data.joints[i].S) for i in joints])
    prismatic = np.abs(subspaces[:, :3]).max(1) > 0.0
    return {
        "prismatic": prismatic,
        "rotation": np.array([model.jointPlacements[i].rotation for i in joints]),
        "translation": np.array([model.jointPlacements[i].translation for i in joints]),
        "axis": np.where(prismatic[:, None], subspaces[:, :3], subspaces[:, 3:]),
        "inertial_parameters": np.array([model.inertias[i].toDynamicParameters() for i in joints]),
        "gravity": np.array(model.gravity.linear),
        "tip": np.array(_tip(model, tip)),
    }


def _tip(model: pin.Model, link: str | None) -> Array:
    """Origin of the named link [m], (3,), in the last joint's frame; if that is zero, of the farthest one."""
    last = model.njoints - 1
    carried = [f for f in model.frames if f.parentJoint == last and f.type == pin.FrameType.BODY]
    named = [f.placement.translation for f in carried if f.name == link and f.placement.translation.any()]
    if named:
        return named[0]
    return max((f.placement.translation for f in carried), key=lambda point: float(np.linalg.norm(point)))


@contextmanager
def pinocchio_errors(description: Description) -> Iterator[None]:
    """Turn Pinocchio's errors into ours, with its parser's output to stderr as the reason."""
    with tempfile.TemporaryFile() as output:
        terminal = os.dup(2)
        os.dup2(output.fileno(), 2)
        try:
            yield
        except (ValueError, RuntimeError, IndexError) as error:
            reason = " ".join(f"{error} {_read(output)}".split())
            raise RobotError(f"{description.path}: Pinocchio refuses it: {reason}") from error
        finally:
            os.dup2(terminal, 2)
            os.close(terminal)
        if complaint := _read(output):  # often the same for every joint
            first, *more = complaint.splitlines()
            others = f" (and {counted(len(more), 'more line')})" if more else ""
            _log.warning("%s: %s%s", description.path, first, others)


def _read(file: BinaryIO) -> str:
    file.seek(0)
    return file.read().decode(errors="replace").strip()
