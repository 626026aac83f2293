"""What is taken out of a raw recording, and told: jumps by a turn, and rows at rest without drives."""

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from sidegan.base.names import counted, listed
from sidegan.recording.recording import Recording
from sidegan.recording.statistics import SLOWEST

_TURN = 2 * np.pi
_AROUND = np.pi / 2  # [rad] that a joint turns by between two samples at most
_GLITCHES = 1e-3  # of the samples, that may jump otherwise
_AT_REST = 0.02  # [rad or m] that encoders differ by in an arm at rest
_WITHOUT_DRIVES = 0.5  # [s] for which every torque stays as it is


def unwrapped(recording: Recording, slides: Sequence[bool]) -> Recording:
    """A recording in which positions of joints that turn go on where a driver begins a turn anew.

    Steps between neighbouring samples are that which are nearly a turn, in a joint none of whose other steps
    is beyond doubt.
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
    said = f"positions of {listed(found)} jump by whole turns: unwrapped, so that they continue beyond ±π"
    return replace(recording, position=position, remarks=(*recording.remarks, said))


def driven(recording: Recording) -> Recording:
    """A recording without rows at rest in which no torque or current of any joint changes: brakes hold it."""
    if recording.torque is recording.current is None:
        return recording
    load = recording.signals()[recording.load]
    time = recording.time
    kept = np.ones(len(time), dtype=bool)
    lost = 0.0
    begins = np.append(True, np.zeros(len(time) - 1, dtype=bool))
    for column in load.T:
        begins[1:] |= np.diff(column) != 0
    begins = np.flatnonzero(begins)
    ends = np.append(begins[1:], len(time)) - 1
    long = np.flatnonzero(time[ends] - time[begins] >= _WITHOUT_DRIVES)
    for begin, end in zip(begins[long], ends[long]):
        if np.ptp(recording.position[begin : end + 1], 0).max() < _AT_REST:
            kept[begin : end + 1] = False
            lost += time[end] - time[begin]
    if kept.all() or not kept.any():
        return recording
    rows = np.flatnonzero(kept)
    whole = len(rows) == rows[-1] - rows[0] + 1  # a part of the memory will do
    part = slice(rows[0], rows[-1] + 1) if whole else rows
    signals: dict[str, Any] = {name: x[part] for name, x in recording.signals().items()}
    first = time[np.argmin(kept)]
    said = (
        f"from {first:.6g} s no {recording.load} changes while the arm rests, as if drives were off: "
        f"{counted(int((~kept).sum()), 'row')}, {lost:.3g} s, left out"
    )
    remarks = (*recording.remarks, said)
    return replace(recording, time=recording.time[part], remarks=remarks, **signals)
