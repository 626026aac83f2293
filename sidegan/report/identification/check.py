"""Tables of the check of recordings, for the terminal."""

from collections.abc import Sequence

import pandas as pd
import torch

from sidegan.recording.check import CheckedRecording
from sidegan.report.export import show


def show_checks(recordings: Sequence[CheckedRecording]) -> None:
    """Print what the check says, as tables."""
    show(sampling_table(recordings), "Recordings")
    show(joint_table(recordings), "Joints [rad, m, N·m, N, A]")
    show(excitation_table(recordings), "Share of each base parameter that no other can stand in for")


def sampling_table(recordings: Sequence[CheckedRecording]) -> pd.DataFrame:
    """A row per recording: its clock, and what is kept of it."""
    rows = {}
    for recording in recordings:
        raw, grid = recording.statistics, recording.grid
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
            "lag [ms]": f"{1e3 * recording.agreement.lag:.0f}",
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("recording")


def joint_table(recordings: Sequence[CheckedRecording]) -> pd.DataFrame:
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
                    "quantum": f"{effort.quantum[j]:.2g}",
                    "saturated": int(effort.clipped[j]),
                    "agrees with the description": f"{recording.agreement.sign[j]:.2f}",
                }
            )
    return pd.DataFrame(rows).set_index(["recording", "joint"])


def excitation_table(recordings: Sequence[CheckedRecording]) -> pd.DataFrame:
    """A row per base parameter, a column per recording."""
    columns = {one.name: [f"{x:.1%}" for x in one.excitation.alone.tolist()] for one in recordings}
    names = list(recordings[0].excitation.names)
    return pd.DataFrame(columns, index=names).rename_axis("base parameter")
