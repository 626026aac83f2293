"""The check of recordings, as a file and as a table on the terminal."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pandas as pd

from sidegan.base.storage import write_json
from sidegan.recording.check import CheckedRecording
from sidegan.report.export import show


def write_checks(recordings: list[CheckedRecording], folder: Path) -> Path:
    """Write the check of recordings; the file's path."""
    path = folder / "check.json"
    write_json(path, [recording.as_json() for recording in recordings])
    return path


def show_checks(recordings: Sequence[CheckedRecording]) -> None:
    """Print what each joint did in recordings: ranges, noise, saturation and sign."""
    rows = []
    for recording in recordings:
        signals = recording.statistics.signals
        load = recording.statistics.load
        position, effort = signals["position"], signals[load]
        noise = None if recording.repeated is None else recording.repeated.noise
        fastest = np.abs(np.concatenate([segment.velocity for segment in recording.segments])).max(0)
        for j, name in enumerate(recording.joint_names):
            rows.append(
                {
                    "recording": recording.name,
                    "joint": name,
                    "position": f"{position.lower[j]:.3g} … {position.upper[j]:.3g}",
                    "fastest": f"{fastest[j]:.3g}",
                    load: f"{effort.lower[j]:.3g} … {effort.upper[j]:.3g}",
                    "between repetitions": "—" if noise is None else f"{noise[j]:.2g}",
                    "quantum": f"{effort.quantum[j]:.2g}",
                    "saturated": int(effort.clipped[j]),
                    "agrees with the description": f"{recording.agreement.sign[j]:.2f}",
                    "multiple of it": f"{recording.agreement.load.scale[j]:.2g}",
                }
            )
    show(pd.DataFrame(rows).set_index(["recording", "joint"]), "Joints [rad, m, N·m, N, A]")
