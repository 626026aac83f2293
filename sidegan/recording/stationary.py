"""Joints that stand still in recordings, and their places in the chain."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from sidegan.base.settings_text import setting_name
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.load import load_recording
from sidegan.recording.recording import Recording
from sidegan.recording.refusals import without_torque
from sidegan.recording.settings import Recorded, RecordingSettings
from sidegan.robot import Arm
from sidegan.robot.sources import read_source
from sidegan.robot.tree import read_tree


def chain_joints(arm: Arm) -> dict[str, bool]:
    """An arm's joints and locked ones between them, from the base outwards: whether each is prismatic."""
    if not arm.setup.locked:
        return dict(zip(arm.joint_names, arm.prismatic.tolist()))
    tree = read_tree(read_source(arm.urdf, arm.setup.args).root, str(arm.urdf))
    wanted = [*arm.joint_names, *arm.setup.locked]
    paths = [tree.path(tree.joints[name].child) for name in wanted]
    last = tree.joints[arm.joint_names[-1]]
    longest = max((path for path in paths if last in path), key=len)
    return {joint.name: joint.kind == "prismatic" for joint in longest if joint.name in wanted}


def load_for(arm: Arm, files: Recorded, settings: RecordingSettings) -> Recording:
    """A recording of an arm; see ``load_recording``."""
    return load_recording(files, settings, arm.joint_names, chain_joints(arm))


def refuse_elsewhere(arm: Arm, recordings: Iterable[Recorded], settings: RecordingSettings) -> None:
    """Refuse recordings in which a locked joint of the chain is not where it is locked.

    Only of those with the positions of locked joints, which most lack.
    """
    chain = chain_joints(arm)
    locked = {k: name for k, name in enumerate(chain) if name not in (*arm.joint_names, *settings.without)}
    if not locked:
        return
    only = replace(settings, velocity=None, acceleration=None, torque=None, current=None)
    for files in recordings:
        try:
            recording = load_recording(files, only, [*chain], chain)
        except RecordingError:  # it has no positions of locked joints
            continue
        for place, name in locked.items():
            q, at = recording.position[:, place], (arm.setup.locked or {})[name]
            if max(abs(q - at)) > thresholds.MOVED:
                raise RecordingError(
                    f"{recording.name}: {name} is locked at {at:.4g} ({setting_name('robot.locked')}), but "
                    f"recorded from {q.min():.4g} to {q.max():.4g} rad or m: lock it where it stood, or "
                    "leave it unlocked"
                )


def stationary_positions(
    arm: Arm, recordings: Iterable[Recorded], settings: RecordingSettings
) -> dict[str, float]:
    """Positions of the joints without a torque [rad or m], from all recordings."""
    if unknown := [name for name in settings.without if name not in arm.joint_names]:
        raise RecordingError(
            f"recording.without names {', '.join(unknown)}; the arm has joints {', '.join(arm.joint_names)}"
        )
    places = [arm.joint_names.index(name) for name in settings.without]
    lacking = np.isin(arm.joint_names, settings.without)
    only = replace(settings, velocity=None, acceleration=None, torque=None, current=None)
    lower = np.full(len(places), np.inf)
    upper = -lower
    for files in recordings:
        recording = load_for(arm, files, only)
        position = recording.position[:, places]
        lower = np.minimum(lower, position.min(0))
        upper = np.maximum(upper, position.max(0))
        for name, low, high in zip(settings.without, lower.tolist(), upper.tolist()):
            if high - low > thresholds.MOVED:
                raise RecordingError(
                    f"{recording.name}: {name} is left out (recording.without), but moves from {low:.4g} to "
                    f"{high:.4g} rad or m, and a joint without torque must stay at one position in all "
                    f"recordings: {without_torque(arm, lacking, lacking, [])}"
                )
    return dict(zip(settings.without, ((lower + upper) / 2).tolist()))
