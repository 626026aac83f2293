"""Commanded trajectories located in a recording and averaged over their repetitions."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import scipy  # submodules load lazily

from sidegan.base.arrays import Array
from sidegan.base.settings_text import suggestion
from sidegan.base.storage import reading
from sidegan.errors import RecordingError
from sidegan.recording import thresholds
from sidegan.recording.recording import Recording
from sidegan.recording.statistics import bandwidth_of
from sidegan.recording.thresholds import LEAST_SCALE

FOLDER = "trajectories"  # in the folder of an excite run
_RATE = 50.0  # [Hz] sampling rate of the search
_ROUNDS = 4  # of refining the start of a repetition


@dataclass(frozen=True, eq=False)
class Commanded:
    """A commanded trajectory."""

    name: str  # of its file
    time: Array  # [s], (T,), from 0
    position: Array  # [rad or m], (T, J)

    def at(self, times: Array) -> tuple[Array, Array]:
        """Positions [rad or m] and velocities at times (S,) [s] within it, (S, J) each."""
        curve = scipy.interpolate.PchipInterpolator(self.time, self.position)
        return curve(times), curve(times, 1)


@dataclass(frozen=True, eq=False)
class Repeated:
    """Repetitions of the commanded trajectories in a recording, and the noise between them."""

    counts: dict[str, int]  # repetitions by name of the trajectory
    # standard deviation of each joint's torque [N·m or N] or current [A] between repetitions, (J,); None
    # without repetitions
    noise: Array | None
    bandwidth: float  # of the commands [Hz]

    @property
    def statement(self) -> str:
        """A sentence on what was found, for people."""
        listed = ", ".join(f"{name} × {count}" for name, count in self.counts.items())
        averaged = "" if self.noise is None else "; repetitions are averaged"
        return f"found the commanded trajectories: {listed}{averaged}"


def commanded_files(path: Path) -> list[Path]:
    """Tables of the commanded trajectories: one file, or those of a folder, a run, or the only run in it."""
    if path.is_file():
        return [path]
    runs = sorted(path.glob(f"*/{FOLDER}"))
    if len(runs) > 1:
        listed = "\n".join(f"  {suggestion('recording.sent', str(run.parent))}" for run in runs)
        raise RecordingError(
            f"{path} has {len(runs)} runs of excite, expected the one that was sent:\n{listed}"
        )
    folder = runs[0] if runs else path / FOLDER if (path / FOLDER).is_dir() else path
    files = sorted((x for x in folder.glob("*.csv") if x.stem.isdecimal()), key=lambda csv: int(csv.stem))
    if not files:
        raise RecordingError(
            f"recording.sent is {path}, expected a table written by excite or the folder of its run"
        )
    return files


def load_commanded(path: Path, joint_names: Sequence[str], coupling: Array) -> list[Commanded]:
    """The trajectories in tables of ``excite``, from whose positions ``coupling``, (J, J), makes joints'."""
    found = []
    for file in commanded_files(path):
        with reading(file, "CSV", RecordingError):
            table = pd.read_csv(file)
            columns = ["time", *(f"q_{name}" for name in joint_names)]
            if missing := [name for name in columns if name not in table]:
                raise RecordingError(f"{file} has no column {', '.join(missing)}: is it for this arm?")
            values = table[columns].to_numpy(np.float64)
        time = values[:, 0]
        if len(time) < 2 or not (np.isfinite(values).all() and (np.diff(time) > 0).all()):
            raise RecordingError(f"{file} is no trajectory: expected two rows or more, at increasing times")
        found.append(Commanded(file.stem, time - time[0], values[:, 1:] @ coupling.T))
    return found


def average_repetitions(
    recording: Recording, sent: Sequence[Commanded], gap: float
) -> tuple[list[Recording], Repeated]:
    """Each commanded trajectory found in a recording, averaged over its repetitions, in order of time.

    Repetitions that contain a gap [s] are left out.
    """
    recording = recording.take(np.append(True, np.diff(recording.time) > 0))
    time, position = recording.time, recording.position
    starts = _starts(time, position, sent, gap)
    if not starts:
        raise RecordingError(
            f"{recording.name} contains none of the commanded trajectories ({len(sent)} sent); "
            "were they executed at another speed, or is recording.sent from another run?"
        )
    step = float(np.median(np.diff(time)))
    curves = {name: scipy.interpolate.PchipInterpolator(time, x) for name, x in recording.signals().items()}
    random = np.random.default_rng(0).standard_normal(position.shape)
    white = scipy.interpolate.PchipInterpolator(time, random)
    found = []
    squares = np.zeros(position.shape[1])  # of the deviations between repetitions
    free = 0  # degrees of freedom of these
    for k, begins in starts.items():
        grid = np.arange(0.0, sent[k].time[-1], step)
        repeats = {name: np.stack([curve(grid + s) for s in begins]) for name, curve in curves.items()}
        means: dict[str, Any] = {name: x.mean(0) for name, x in repeats.items()}
        found.append(Recording(recording.name, recording.joint_names, grid + begins[0], **means))
        if len(begins) > 1:
            # interpolation attenuates noise; interpolating white noise shows by how much
            left = np.mean([white(grid + start) ** 2 for start in begins])
            squares += ((repeats[recording.load] - means[recording.load]) ** 2).sum((0, 1)) / left
            free += (len(begins) - 1) * len(grid)
    noise = np.sqrt(squares / free) if free else None
    counts = {sent[k].name: len(begins) for k, begins in starts.items()}
    bandwidth = max(bandwidth_of(x.name, x.time, x.position, float(np.median(np.diff(x.time)))) for x in sent)
    found.sort(key=lambda mean: float(mean.time[0]))
    return found, Repeated(counts, noise, bandwidth)


def _starts(time: Array, position: Array, sent: Sequence[Commanded], gap: float) -> dict[int, list[float]]:
    """Start times [s] of trajectories, by their number; no two overlap."""
    step = 1 / _RATE
    grid = np.arange(time[0], time[-1], step)
    velocity = np.gradient(np.stack([np.interp(grid, time, q) for q in position.T], 1), step, axis=0)
    alike = [_correlation(velocity, x.at(np.arange(0.0, x.time[-1], step))[1]) for x in sent]
    lengths = [round(float(x.time[-1]) / step) for x in sent]
    holes = time[:-1][np.diff(time) > gap]
    starts: dict[int, list[float]] = {}
    while True:
        k = int(np.argmax([x.max(initial=0.0) for x in alike]))
        if alike[k].max(initial=0.0) < thresholds.COMMANDED:
            return {k: sorted(starts[k]) for k in sorted(starts)}
        at = int(alike[k].argmax())
        start = _start_time(time, position, sent[k], float(grid[at]))
        for x, length in zip(alike, lengths):  # no other trajectory may overlap this one
            x[max(0, at - length + 1) : at + lengths[k]] = 0.0
        if start is not None and not ((holes >= start) & (holes < start + sent[k].time[-1])).any():
            starts.setdefault(k, []).append(start)


def _correlation(velocity: Array, wanted: Array) -> Array:
    """Correlation, −1 to 1, of velocities (S, J) with wanted ones (T, J), by the sample where these start."""
    if len(wanted) > len(velocity):
        return np.zeros(0)
    match = sum(scipy.signal.correlate(v, w, "valid", "fft") for v, w in zip(velocity.T, wanted.T))
    energy = np.cumsum(np.append(0.0, (velocity**2).sum(1)))
    power = np.maximum((energy[len(wanted) :] - energy[: -len(wanted)]) * (wanted**2).sum(), LEAST_SCALE)
    return match / np.sqrt(power)


def _start_time(time: Array, position: Array, sent: Commanded, start: float) -> float | None:
    """Start time of a trajectory [s]; None if it is another one or incomplete.

    Servo lag is included: repetitions are averaged with each other, not compared with the commands.
    """
    grid = np.arange(0.0, sent.time[-1], 1 / _RATE)
    wanted, rate = sent.at(grid)
    for _ in range(_ROUNDS):
        now = np.stack([np.interp(grid + start, time, q) for q in position.T], 1)
        error = now - wanted
        off = np.abs(error.mean(0)).max()
        error -= error.mean(0)
        start -= float((error * (rate - rate.mean(0))).sum() / (rate**2).sum())
    first = float(time[0])
    last = float(time[-1] - sent.time[-1])
    slack = 1 / _RATE
    inside = first - slack <= start <= last + slack
    return min(max(start, first), last) if inside and off < thresholds.COMMANDED_PLACE else None
