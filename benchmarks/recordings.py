"""Errors of models identified from recordings of real arms, by several methods, as a table in Markdown.

    python -m benchmarks.recordings FOLDER

FOLDER has a folder for each arm, with its recordings, its description and ``arm.yaml``. To add an arm, write
one; all but the source are arguments of ``sidegan.Cell`` and ``sidegan.identify``:

    source: whose recordings these are, and their licence    # a note below the table
    cell: {robot: arm.urdf}                                  # paths begin at arm.yaml
    recordings: [a.csv, b.csv]
    validation: [c.csv]                                      # or the share to hold out, 0.3
    gains: [14.87, 13.26, 11.13, 10.62, 11.03, 11.47]        # if currents were recorded
    recording: {cutoff: 5, delay: null}
    model: {rotor_inertia: true, sign_width: 0.01}

All methods get the same samples, filtered and with delays corrected by sidegan, and predict the same torques.
CPU time is from these samples to the errors, on one thread, the second time; sidegan's includes its verdict.
FIGAROH is optional: ``pip install figaroh``.
"""

import logging
import sys
import time
from collections.abc import Callable
from contextlib import chdir
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd
import yaml

from benchmarks.opponents import figaroh_torque, pinocchio_torque
from sidegan import Cell, EstimationSettings, SideganError, Terms, check_recordings
from sidegan.base.arrays import Array, geometric_mean
from sidegan.base.storage import reading
from sidegan.base.threads import one_thread
from sidegan.base.typed import build, settings_of
from sidegan.errors import ConfigError
from sidegan.identification import Measurements
from sidegan.identification.identified import measurements_of
from sidegan.identification.measurements import subsample
from sidegan.report.export import markdown
from sidegan.robot import Arm
from sidegan.steps.identify import Checked, identified


@dataclass(frozen=True, kw_only=True)
class ArmFile:
    """Contents of an ``arm.yaml``."""

    source: str
    cell: dict[str, Any]
    recordings: list[Any]
    validation: list[Any] | float
    gains: list[float] | None = None
    recording: dict[str, Any] = field(default_factory=dict)
    model: dict[str, Any] = field(default_factory=dict)

    def __post_init__(self) -> None:
        if not self.validation:
            raise ConfigError("validation is empty, expected recordings or the share to hold out")


class Recorded(NamedTuple):
    """An arm and its checked recordings."""

    file: ArmFile
    cell: Cell
    checked: Checked

    @property
    def samples(self) -> list[Measurements]:
        """All samples to identify from, and all to test with."""
        groups = self.checked.training, self.checked.validation
        return [subsample(measurements_of(recordings), sys.maxsize) for recordings in groups]


def load(path: Path) -> Recorded:
    """The arm of an ``arm.yaml``; ConfigError or RecordingError when a setting or a file is wrong."""
    with reading(path, "YAML", ConfigError):
        file = build(ArmFile, yaml.safe_load(path.read_text(encoding="utf-8")) or {})
    with chdir(path.parent):
        cell = Cell(**file.cell)
        options: dict[str, Any] = {"recording": file.recording, "gains": file.gains}
        options["sign_width"] = settings_of(Terms, file.model).sign_width
        return Recorded(file, cell, check_recordings(cell, file.recordings, file.validation, **options))


def opponent(predict: Callable[[Arm, Measurements, Measurements], Array], arm: Recorded) -> Array:
    """An opponent's model, from the torques that it predicts."""
    training, validation = arm.samples
    predicted = predict(arm.checked.arm, training, validation)
    return np.square(validation.torque - predicted).mean(0) / validation.torque.var(0)


def sidegan(arm: Recorded, **changes: Any) -> Array:
    """The model that sidegan recommends, with changes to the terms of its torques."""
    terms = settings_of(Terms, arm.file.model | changes)
    found = identified(arm.cell, arm.checked, terms, EstimationSettings()).arm
    return found.tested[found.use].nmse


# Errors, (J,), of the held-out torques.
METHODS: dict[str, Callable[[Recorded], Array]] = {
    "Pinocchio, least squares": partial(opponent, pinocchio_torque),
    "FIGAROH": partial(opponent, figaroh_torque),
    "sidegan, model.effects=none": partial(sidegan, effects="none"),
    "sidegan": sidegan,
}


def row(method: str, arm: Recorded) -> dict[str, str]:
    """Errors and CPU time of a method, or why there are none."""
    try:
        for _ in range(2):  # the first time compiles
            start = time.process_time()
            nmse = METHODS[method](arm)
            spent = time.process_time() - start
    except (ImportError, SideganError, ValueError, np.linalg.LinAlgError) as error:
        return {"nMSE of each joint": str(error)}
    numbers = {"nMSE of each joint": [*nmse], "mean": [nmse.mean()]}
    numbers |= {"geometric mean": [geometric_mean(nmse)], "CPU s": [spent]}
    return {name: ", ".join(f"{x:.2g}" for x in values) for name, values in numbers.items()}


def report(folder: Path) -> str:
    """The table, and a note on each arm; ConfigError when there is no arm, and the errors of ``load``."""
    arms = {path.parent.name: load(path) for path in sorted(folder.glob("*/arm.yaml"))}
    if not arms:
        raise ConfigError(f"{folder} has no arm, expected a folder for each, with an arm.yaml")
    with one_thread():
        rows = [{"arm": name, "method": x, **row(x, arm)} for name, arm in arms.items() for x in METHODS]
    notes = [f"- {name}: {arm.file.source}" for name, arm in arms.items()]
    return "\n".join([markdown(pd.DataFrame(rows)), "", *notes, ""])


if __name__ == "__main__":
    logging.disable(logging.WARNING)
    sys.stdout.write(report(Path(*sys.argv[1:])))
