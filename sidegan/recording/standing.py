"""Joints that stand still in recordings, and their places in the chain that files name or number."""

from collections.abc import Iterable
from dataclasses import replace

import torch

from sidegan.errors import RecordingError
from sidegan.recording.load import Source
from sidegan.recording.plausibility import HARDLY
from sidegan.recording.settings import Recorded, RecordingSettings
from sidegan.robot import Arm
from sidegan.robot.sources import read_source
from sidegan.robot.tree import read_tree


def chain_of(arm: Arm) -> tuple[str, ...]:
    """Names of an arm's joints and of those that its setup locks on their way, from the base outwards."""
    if not arm.setup.locked:
        return arm.joint_names
    tree = read_tree(read_source(arm.urdf, arm.setup.args).root, str(arm.urdf))
    wanted = {*arm.joint_names, *arm.setup.locked}
    paths = [[joint.name for joint in tree.path(tree.joints[name].child)] for name in wanted]
    longest = max((path for path in paths if arm.joint_names[-1] in path), key=len)
    return tuple(name for name in longest if name in wanted)


def standing(arm: Arm, recordings: Iterable[Recorded], settings: RecordingSettings) -> dict[str, float]:
    """Where the joints without a torque stand [rad or m], from the positions in all recordings.

    Raises:
        RecordingError: when the arm has no such joint, or one moves.
    """
    if unknown := [name for name in settings.without if name not in arm.joint_names]:
        raise RecordingError(
            f"recording.without names {', '.join(unknown)}; the arm has joints {', '.join(arm.joint_names)}"
        )
    places = [arm.joint_names.index(name) for name in settings.without]
    only = replace(settings, velocity=None, acceleration=None, torque=None, current=None)
    chain = chain_of(arm)
    ends: list[torch.Tensor] = []  # least and largest positions of pieces, (2, K) each
    for one in recordings:
        source = Source(one, only, arm.joint_names, settings.rows, chain)
        for part in source:
            position = part.position[:, places]
            ends += [torch.stack([position.amin(0), position.amax(0)])] if len(position) else []
            _refuse_moving(source.name, settings.without, torch.stack(ends))
    each = torch.stack(ends)
    return dict(zip(settings.without, ((each.amin((0, 1)) + each.amax((0, 1))) / 2).tolist()))


def _refuse_moving(file: str, names: list[str], ends: torch.Tensor) -> None:
    """Raise when a joint moves, of whose positions the ends are given [rad or m], (…, 2, K)."""
    for name, low, high in zip(names, ends.amin((0, 1)).tolist(), ends.amax((0, 1)).tolist()):
        if high - low > HARDLY:
            raise RecordingError(
                f"{file}: {name}, which recording.without leaves out, moves from {low:.4g} to {high:.4g} rad "
                "or m, but a joint without a torque has to stand still in all recordings, and at one place: "
                "record with it held, or record its torque"
            )
