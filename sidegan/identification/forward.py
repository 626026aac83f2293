"""A model simulated forwards: recorded torques drive it in MuJoCo, and its motion leaves the recorded one."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import torch
from scipy.interpolate import CubicSpline
from torch import Tensor

from sidegan.plant import Run, driven
from sidegan.recording.recording import Segment
from sidegan.robot import Arm, Drives

_RATE = 1000.0  # [Hz] of the simulation
_HORIZONS = 20  # at which errors are told
_STARTS = 24  # moments from which the model is let go, at most
_LEAST = 5  # samples of a stretch that curves are drawn through
_BANDWIDTH = 1.0  # of the servos that hold the model near the recorded motion [Hz]
_TAIL = 0.9  # of all starts, whose error is told beside the root mean square


@dataclass(frozen=True, eq=False)
class Forward:
    """How far simulated joints are off recorded ones, against the time since they were the same."""

    horizon: Tensor  # [s], (H,)
    free: Tensor  # root mean square error driven by recorded torques alone [rad or m], (H, J)
    tail: Tensor  # the error that nine in ten starts stay below, (H, J)
    held: Tensor  # the first with servos beside them, of a bandwidth of 1 Hz, (H, J)
    starts: int  # moments from which the model was let go

    def as_json(self) -> dict[str, Any]:
        """All of it as plain values; None in place of what is not finite."""
        each = {name: getattr(self, name) for name in ("horizon", "free", "tail", "held")}
        finite = {name: x.numpy().astype(object) for name, x in each.items()}
        for name, x in each.items():
            finite[name][~x.isfinite().numpy()] = None
        plain = {name: x.tolist() for name, x in finite.items()}
        return {**plain, "starts": self.starts}


def forward_errors(
    arm: Arm,
    drives: Drives,
    offset: Tensor,
    segments: Sequence[Segment],
    longest: float = 1.0,
) -> Forward | None:
    """Errors of a model that recorded torques drive, up to a horizon [s]; None where these are too short.

    Every start is from a recorded state. Without feedback an error of the torque is integrated twice; the
    servos' share shows what a controller would leave of it.

    Args:
        arm: with the model's links, which have to be physically consistent.
        drives: its friction and rotors.
        offset: of the torques [N·m or N], (J,), which move nothing.
        segments: recorded motion and torques.
        longest: horizon [s].
    """
    steps = round(longest * _RATE)
    runs = [run for one in segments for run in _runs(one, offset, steps, longest)]
    if not runs:
        return None
    runs = runs[:: -(-len(runs) // _STARTS)]
    free, held = (driven(arm, drives, runs, _RATE, bandwidth) for bandwidth in (None, _BANDWIDTH))
    wanted = np.stack([run.position[1:] for run in runs])
    at = np.linspace(steps / _HORIZONS, steps, _HORIZONS).round().astype(int) - 1
    off, kept = (torch.from_numpy(np.abs(x - wanted)[:, at]) for x in (free, held))
    return Forward(
        horizon=torch.from_numpy((at + 1) / _RATE),
        free=off.square().mean(0).sqrt(),
        tail=off.quantile(_TAIL, 0),
        held=kept.square().mean(0).sqrt(),
        starts=len(runs),
    )


def _runs(segment: Segment, offset: Tensor, steps: int, longest: float) -> Iterator[Run]:
    """Stretches of a recording, at 1 kHz."""
    time = segment.time.numpy()
    if len(time) < _LEAST or time[-1] - time[0] < longest:
        return
    states = segment.position, segment.velocity, segment.torque - offset
    curves = [CubicSpline(time, x.numpy()) for x in states]
    for start in np.arange(time[0], time[-1] - longest, longest):
        grid = start + np.arange(steps + 1) / _RATE
        q, dq, torque = (curve(grid) for curve in curves)
        yield Run(q, dq, (torque[1:] + torque[:-1]) / 2)
