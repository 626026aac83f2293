"""Repairs of a raw recording, with a remark on each: unwrapped positions, glitches, rows with drives off."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted, listed
from sidegan.recording import thresholds
from sidegan.recording.clock import stamp_text
from sidegan.recording.grid import constant_ranges
from sidegan.recording.recording import Recording

_TURN = 2 * np.pi


def unwrap(recording: Recording, slides: Sequence[bool]) -> Recording:
    """A recording with the positions of revolute joints unwrapped.

    Only steps of nearly whole turns are removed, and only of joints with hardly any other jumps.
    """
    near = np.diff(recording.time) < thresholds.LONGEST_STEP
    position = recording.position
    found: list[str] = []
    for j, name in enumerate(recording.joint_names):
        steps = np.where(near, np.diff(position[:, j]), 0.0)
        turns = np.round(steps / _TURN)
        odd = np.abs(steps - _TURN * turns) > thresholds.LARGEST_ROTATION
        turns[odd] = 0.0
        if not slides[j] and turns.any() and odd.mean() < thresholds.OTHER_JUMPS:
            position = position if found else position.copy()
            position[1:, j] -= _TURN * np.cumsum(turns)
            found.append(name)
    if not found:
        return recording
    remark = f"positions of {listed(found)} jump by whole turns: unwrapped, so that they go on beyond a turn"
    return replace(recording, position=position, remarks=(*recording.remarks, remark))


def remove_glitches(recording: Recording, speed: Array) -> Recording:
    """A recording without samples whose position is far from the neighbours' but returns: lost packets, say.

    Far is more than the joint can move meanwhile at its ``speed`` [rad/s or m/s], (J,), and many times its
    usual steps. Jumps that stay, for more than four samples, are left for ``refuse_jumps``.
    """
    time = recording.time
    last, side = len(time) - 1, thresholds.JUMP_SAMPLES
    wrong: dict[str, Array] = {}
    for name, q, limit in zip(recording.joint_names, recording.position.T, speed.tolist()):
        moved = np.append(np.abs(np.diff(q)), 0.0)
        usual = float(np.quantile(moved, thresholds.GLITCH_QUANTILE))
        far = max(thresholds.JUMP, thresholds.JUMP_STEPS * usual)
        jumps = np.flatnonzero(moved > far)
        near = np.unique((jumps[:, None] + np.arange(-side, side + 2)).clip(0, last))
        first = (near - side).clip(0, max(0, last - 2 * side))  # at the ends, the last few
        around = np.minimum(first[:, None] + np.arange(2 * side + 1), last)
        meanwhile = np.ptp(time[around], 1) * (limit if np.isfinite(limit) else 0.0)
        off = np.abs(q[near] - np.median(q[around], 1))
        wrong[name] = near[off > np.maximum(far, meanwhile)]
    rows = np.unique(np.concatenate([*wrong.values()]))
    if not len(rows):
        return recording
    joints = listed([name for name, found in wrong.items() if len(found)])
    times = listed([*map(stamp_text, time[rows].tolist())], 3)
    remark = f"the position of {joints} jumps and returns at {times}: {counted(len(rows), 'sample')} left out"
    left = recording.take(np.delete(np.arange(len(time)), rows))
    return replace(left, remarks=(*recording.remarks, remark))


def remove_undriven(recording: Recording) -> Recording:
    """A recording without rows at rest in which no joint's torque or current changes: brakes hold the arm."""
    if recording.torque is recording.current is None:
        return recording
    time = recording.time
    kept = np.ones(len(time), dtype=bool)
    lost = 0.0
    begins, ends = constant_ranges(recording.signals()[recording.load])
    long = np.flatnonzero(time[ends] - time[begins] >= thresholds.DRIVES_OFF)
    for begin, end in zip(begins[long], ends[long]):
        if np.ptp(recording.position[begin : end + 1], 0).max() < thresholds.MOVED:
            kept[begin : end + 1] = False
            lost += time[end] - time[begin]
    if kept.all() or not kept.any():
        return recording
    first = time[np.argmin(kept)]
    remark = (
        f"from {stamp_text(first)} no {recording.load} changes while the arm rests, as if drives were off: "
        f"{counted(int((~kept).sum()), 'row')}, {lost:.3g} s, left out"
    )
    return replace(recording.take(kept), remarks=(*recording.remarks, remark))
