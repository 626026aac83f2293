"""Libraries that come from elsewhere: some trajectories are looked at again before they are believed."""

from pathlib import Path

import torch

from sidegan.errors import ArtifactError
from sidegan.library.collection import Library
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check

_LOOKED_AT = 8  # trajectories, from the first to the last
_TOLERANCE = 0.02  # of 1 and of the margin itself: a search ends at other cells in another workspace
_KNOWN = ("position", "velocity")  # margins that need no workspace


def load_foreign(path: Path, arm: Arm) -> Library:
    """Library of a file that nobody vouches for, after a spot check; otherwise as ``Library.load``.

    What calls itself valid must have no negative margin, and of some of those the margins are computed
    again, in free space.

    Raises:
        ArtifactError: when the file cannot be used, or what it says about a trajectory is not so.
    """
    library = Library.load(path, arm)
    if not len(library):
        raise ArtifactError(f"{path} holds no trajectories")
    least = torch.stack([*library.margins.values()]).amin(0)
    lying = (library.valid & (least < 0)).nonzero()[:, 0]
    if len(lying):
        raise ArtifactError(f"{path}: trajectory {int(lying[0])} calls itself valid with a negative margin")
    valid = library.valid.nonzero()[:, 0]
    if len(valid):
        _spot_check(path, arm, library.take(valid[torch.linspace(0, len(valid) - 1, _LOOKED_AT).long()]))
    return library


def _spot_check(path: Path, arm: Arm, few: Library) -> None:
    """Refuse valid trajectories that are none, or whose margins are others."""
    trajectory = Trajectory(arm.joints, few.coefficients.shape[2], few.period, few.home)
    found = check(Constraints(arm, torque="torque" in few.margins), trajectory, few.coefficients)
    if not found.valid.all():
        fault = found.failures(int((~found.valid).nonzero()[0]))[0]
        raise ArtifactError(f"{path}: a trajectory that calls itself valid violates {fault}")
    for name in _KNOWN:
        stored, again = few.margins.get(name), found.margins[name]
        if stored is None or ((stored - again).abs() > _TOLERANCE * (1 + again.abs())).any():
            raise ArtifactError(f"{path}: the margins of {name} are not those of its trajectories")
