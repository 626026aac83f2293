"""Stage check: what recordings are worth, before anything is fitted to them."""

from collections.abc import Sequence

import pandas as pd
import torch

from sidegan.base.storage import write_json
from sidegan.errors import ConfigError
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.stages.identify_read import Examined, examined
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import show
from sidegan.robot import load_robot

CHECK = "check.json"


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Read and check the configured recordings, and leave what was found in the run's folder.

    Raises:
        ConfigError: when no recordings are given.
        RecordingError: when one cannot be used.
    """
    if not cfg.recordings:
        raise ConfigError("recordings is empty, expected files to check: 'recordings=[a.csv,b.csv]'")
    arm = load_robot(cfg.robot.name)
    found = [*examined(cfg, arm, cfg.recordings, "training")]
    found += examined(cfg, arm, cfg.validation, "validation")
    tell(found)
    path = store.run_folder / CHECK
    write_json(path, [one.findings.plain() for one in found])
    tracker.log_artifact(path, "identify")


def tell(found: Sequence[Examined]) -> None:
    """Print what was found, as tables."""
    show(sampling_table(found), "Recordings")
    show(joint_table(found), "Joints [rad, m, N·m, N, A]")
    show(excitation_table(found), "Share of each base parameter that no other can stand in for")


def sampling_table(found: Sequence[Examined]) -> pd.DataFrame:
    """A row per recording: its clock, and what is kept of it."""
    rows = {}
    for one in found:
        known, grid = one.findings.survey, one.findings.grid
        rows[one.name] = {
            "use": one.role,
            "samples": known.samples,
            "seconds": f"{known.duration:.4g}",
            "rate [Hz]": f"{1 / known.step:.4g}",
            "jitter": f"{known.jitter:.1%}",
            "gaps": len(known.gaps),
            "duplicates": known.duplicates,
            "corrupt": len(known.corrupt),
            "bandwidth [Hz]": f"{grid.bandwidth:.3g}",
            "cut-off [Hz]": f"{grid.cutoff:.3g}",
            "kept": one.findings.kept,
            "lag [ms]": f"{1e3 * one.findings.lag:.0f}",
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("recording")


def joint_table(found: Sequence[Examined]) -> pd.DataFrame:
    """A row per recording and joint: ranges, noise floor, saturation and sign."""
    rows = []
    for one in found:
        signals = one.findings.survey.signals
        load = "torque" if "torque" in signals else "current"
        position, effort = signals["position"], signals[load]
        fastest = torch.cat([segment.velocity for segment in one.segments]).abs().amax(0)
        for j, name in enumerate(one.joint_names):
            rows.append(
                {
                    "recording": one.name,
                    "joint": name,
                    "position": f"{position.lower[j]:.3g} … {position.upper[j]:.3g}",
                    "fastest": f"{fastest[j]:.3g}",
                    load: f"{effort.lower[j]:.3g} … {effort.upper[j]:.3g}",
                    "noise floor": f"{effort.noise[j]:.2g}",
                    "quantum": f"{effort.quantum[j]:.2g}",
                    "saturated": int(effort.clipped[j]),
                    "agrees with the description": f"{one.findings.sign[j]:.2f}",
                }
            )
    return pd.DataFrame(rows).set_index(["recording", "joint"])


def excitation_table(found: Sequence[Examined]) -> pd.DataFrame:
    """A row per base parameter, a column per recording."""
    columns = {one.name: [f"{x:.1%}" for x in one.findings.excited.alone.tolist()] for one in found}
    names = list(found[0].findings.excited.names)
    return pd.DataFrame(columns, index=names).rename_axis("base parameter")
