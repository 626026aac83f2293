"""Repairs of a raw recording, with a remark on each: unwrapped positions, glitches, rows with drives off."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sidegan.base.arrays import Array
from sidegan.base.names import counted, listed
from sidegan.recording.grid import held
from sidegan.recording.recording import Recording
from sidegan.recording.statistics import SLOWEST

_TURN = 2 * np.pi
_AROUND = np.pi / 2  # [rad] largest rotation between two samples
_GLITCHES = 1e-3  # share of samples that may jump otherwise
_FAR = 0.02  # [rad or m] from the neighbours' median, up to which a sample is no jump
_MANY, _OFTEN = 5.0, 0.95  # times this quantile of the steps between samples, up to which it is none
_NEAR = 4  # neighbours on either side, and most samples until a position returns
_AT_REST = 0.02  # [rad or m] range of encoder readings at rest
_WITHOUT_DRIVES = 0.5  # [s] of constant torques from which drives are off


def unwrapped(recording: Recording, slides: Sequence[bool]) -> Recording:
    """A recording with the positions of revolute joints unwrapped.

    Only steps of nearly whole turns are removed, and only of joints with hardly any other jumps.
    """
    near = np.diff(recording.time) < SLOWEST
    position = recording.position
    found: list[str] = []
    for j, name in enumerate(recording.joint_names):
        steps = np.where(near, np.diff(position[:, j]), 0.0)
        turns = np.round(steps / _TURN)
        odd = np.abs(steps - _TURN * turns) > _AROUND
        turns[odd] = 0.0
        if not slides[j] and turns.any() and odd.mean() < _GLITCHES:
            position = position if found else position.copy()
            position[1:, j] -= _TURN * np.cumsum(turns)
            found.append(name)
    if not found:
        return recording
    remark = f"positions of {listed(found)} jump by whole turns: unwrapped, so that they continue beyond ±π"
    return replace(recording, position=position, remarks=(*recording.remarks, remark))


def steadied(recording: Recording, speed: Array) -> Recording:
    """A recording without samples whose position is far from the neighbours' but returns: lost packets, say.

    Far is more than the joint can move meanwhile at its ``speed`` [rad/s or m/s], (J,), and many times its
    usual steps. Jumps that stay, for more than four samples, are left for ``refuse_jumps``.
    """
    time, position = recording.time, recording.position
    wrong: dict[str, Array] = {}
    for name, q, limit in zip(recording.joint_names, position.T, speed.tolist()):
        moved = np.abs(np.diff(q))
        far = max(_FAR, _MANY * float(np.quantile(np.append(moved, 0.0), _OFTEN)))
        jumps = np.flatnonzero(moved > far)
        near = np.unique(np.clip(jumps[:, None] + np.arange(-_NEAR, _NEAR + 2), 0, len(q) - 1))
        first = np.clip(near - _NEAR, 0, max(0, len(q) - 2 * _NEAR - 1))  # at the ends, the last few
        around = np.minimum(first[:, None] + np.arange(2 * _NEAR + 1), len(q) - 1)
        meanwhile = np.ptp(time[around], 1) * (limit if np.isfinite(limit) else 0.0)
        off = np.abs(q[near] - np.median(q[around], 1))
        wrong[name] = near[off > np.maximum(far, meanwhile)]
    rows = np.unique(np.concatenate([*wrong.values()]))
    if not len(rows):
        return recording
    joints = listed([name for name, found in wrong.items() if len(found)])
    times = listed([f"{t:.6g}" for t in time[rows].tolist()], 3)
    remark = (
        f"the position of {joints} jumps and returns at {times} s: {counted(len(rows), 'sample')} left out"
    )
    return _only(recording, np.delete(np.arange(len(time)), rows), remark)


def driven(recording: Recording) -> Recording:
    """A recording without rows at rest in which no joint's torque or current changes: brakes hold the arm."""
    if recording.torque is recording.current is None:
        return recording
    time = recording.time
    kept = np.ones(len(time), dtype=bool)
    lost = 0.0
    begins, ends = held(recording.signals()[recording.load])
    long = np.flatnonzero(time[ends] - time[begins] >= _WITHOUT_DRIVES)
    for begin, end in zip(begins[long], ends[long]):
        if np.ptp(recording.position[begin : end + 1], 0).max() < _AT_REST:
            kept[begin : end + 1] = False
            lost += time[end] - time[begin]
    if kept.all() or not kept.any():
        return recording
    rows = np.flatnonzero(kept)
    whole = len(rows) == rows[-1] - rows[0] + 1  # a view needs no copy
    part = slice(rows[0], rows[-1] + 1) if whole else rows
    first = time[np.argmin(kept)]
    remark = (
        f"from {first:.6g} s no {recording.load} changes while the arm rests, as if drives were off: "
        f"{counted(int((~kept).sum()), 'row')}, {lost:.3g} s, left out"
    )
    return _only(recording, part, remark)


def _only(recording: Recording, rows: Array | slice, remark: str) -> Recording:
    """Some rows of a recording, with a remark on the others."""
    signals: dict[str, Any] = {name: x[rows] for name, x in recording.signals().items()}
    return replace(recording, time=recording.time[rows], remarks=(*recording.remarks, remark), **signals)
