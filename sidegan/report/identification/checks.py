"""The check of recordings, as a file and as tables on the terminal."""

from collections.abc import Sequence
from pathlib import Path

import pandas as pd
import torch

from sidegan.base.storage import write_json
from sidegan.recording.check import CheckedRecording
from sidegan.report.export import show

CHECK = "check.json"


def write_checks(recordings: list[CheckedRecording], folder: Path) -> Path:
    """Write the check of recordings; the file's path."""
    write_json(folder / CHECK, [recording.as_json() for recording in recordings])
    return folder / CHECK


def show_checks(recordings: Sequence[CheckedRecording]) -> None:
    """Print the check of recordings, as tables."""
    show(_sampling(recordings), "Recordings")
    show(_joints(recordings), "Joints [rad, m, N·m, N, A]")


def _sampling(recordings: Sequence[CheckedRecording]) -> pd.DataFrame:
    """A row per recording: its clock, and what is kept of it."""
    rows = {}
    for recording in recordings:
        raw, grid, repeated = recording.statistics, recording.grid, recording.repeated
        rows[recording.name] = {
            "use": recording.role,
            "samples": raw.samples,
            "seconds": f"{raw.duration:.4g}",
            "rate [Hz]": f"{1 / raw.step:.4g}",
            "jitter": f"{raw.jitter:.1%}",
            "gaps": len(raw.gaps),
            "duplicates": raw.duplicates,
            "corrupt": len(raw.corrupt),
            "bandwidth [Hz]": f"{grid.bandwidth:.3g}",
            "cut-off [Hz]": f"{grid.cutoff:.3g}",
            "kept": recording.kept,
            "lag [ms]": f"{1e3 * recording.lag:.3g}",
            "repetitions": "—" if repeated is None else f"{sum(repeated.counts.values())}",
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("recording")


def _joints(recordings: Sequence[CheckedRecording]) -> pd.DataFrame:
    """A row per recording and joint: ranges, noise floor, saturation and sign."""
    rows = []
    for recording in recordings:
        signals = recording.statistics.signals
        load = "torque" if "torque" in signals else "current"
        position, effort = signals["position"], signals[load]
        fastest = torch.cat([segment.velocity for segment in recording.segments]).abs().amax(0)
        for j, name in enumerate(recording.joint_names):
            rows.append(
                {
                    "recording": recording.name,
                    "joint": name,
                    "position": f"{position.lower[j]:.3g} … {position.upper[j]:.3g}",
                    "fastest": f"{fastest[j]:.3g}",
                    load: f"{effort.lower[j]:.3g} … {effort.upper[j]:.3g}",
                    "noise floor": f"{effort.noise[j]:.2g}",
                    "between repetitions": "—" if recording.noise is None else f"{recording.noise[j]:.2g}",
                    "quantum": f"{effort.quantum[j]:.2g}",
                    "saturated": int(effort.clipped[j]),
                    "agrees with the description": f"{recording.agreement.sign[j]:.2f}",
                    "multiple of it": f"{recording.agreement.load.scale[j]:.2g}",
                }
            )
    return pd.DataFrame(rows).set_index(["recording", "joint"])
