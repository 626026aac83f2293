"""Settings of the group ``recording``: columns of a file, their units, and preprocessing."""

import re
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

import numpy as np
from pydantic import Field

from sidegan.base.arrays import Array
from sidegan.base.settings_text import suggest_fields
from sidegan.base.typed import Hertz, NonNegative, Seconds, Text
from sidegan.errors import ConfigError
from sidegan.recording.units import Units
from sidegan.robot.coupling import Rows, coupling_matrix, coupling_rows

SIGNALS = ("position", "velocity", "acceleration", "torque", "current")
PLACEHOLDER = re.compile(r"\{(joint|index|index0)\}")
AUTO = "auto"  # instead of a pattern: columns are recognised by their names


@dataclass(frozen=True, kw_only=True)
class RecordingSettings:
    """Columns of a recording's file, how it was recorded, and how to preprocess it.

    A signal is a pattern with ``{joint}`` (the joint's name), ``{index}`` (from 1) or ``{index0}`` (from
    0), the name of an array (S, J), or ``auto``; alternatives between bars are tried in turn. Position and
    every configured pattern must exist. Other signals are optional with ``auto``, but a signal of only some
    joints is refused.
    """

    time: str = AUTO
    position: str = AUTO
    velocity: str | None = AUTO
    acceleration: str | None = AUTO
    torque: str | None = AUTO
    current: str | None = AUTO
    units: Units = Units()
    joints: list[Text] | None = None  # the file's joint names, in the arm's order; null: the arm's
    # joints without a torque, which stand still and are locked where they stand
    without: list[Text] = field(default_factory=list)
    topic: str | None = None  # of a bag; null: the only topic of joint states
    effort: Literal["torque", "current"] = "torque"  # meaning of effort in files
    rate: Hertz | None = None  # sampling rate [Hz] of files without time stamps
    # joints whose torque or current has the opposite sign
    reverse: list[Text] = field(default_factory=list)
    # joints whose position is a sum of columns: {joint: {column: factor}}, columns named like joints
    coupling: Rows | None = None
    torque_coupling: Rows | None = None  # the same for torques; null: those of ``coupling``, by virtual work
    cutoff: Hertz | None = None  # of the zero-phase low-pass [Hz]; null: twelve times the motion's bandwidth
    # longest time that is interpolated over [s]; null: five samples, or a quarter of the cut-off's period
    gap: Seconds | None = None
    still: NonNegative = 0.02  # speed below which a joint is at rest [rad/s or m/s]; 0 keeps all samples
    # delay of torques behind states [s], which is removed; null: measured
    delay: Annotated[float, Field(ge=-2, le=2)] | None = 0.0
    # commanded trajectories: a table written by excite, or the folder of its run; null: unknown
    sent: str | None = None

    def __post_init__(self) -> None:
        for signal in SIGNALS:
            pattern = getattr(self, signal)
            if pattern is not None and re.search(r"[{}]", PLACEHOLDER.sub("", pattern)):
                raise ConfigError(
                    f"{signal} is {pattern!r}, expected only {{joint}}, {{index}} and {{index0}} in braces"
                )

        if self.joints is not None and len(set(self.joints)) < len(self.joints):
            raise ConfigError(f"joints is {self.joints}, expected each name once")

    def patterns(self, signal: str) -> list[str]:
        """Patterns of a signal's columns, to be tried in turn; none if it is not to be read."""
        return [*filter(None, (getattr(self, signal) or "").split("|"))]

    def motion_matrix(self, joint_names: Sequence[str]) -> Array:
        """The matrix C, (J, J), of positions, velocities and accelerations: q = C q_recorded."""
        return coupling_matrix("recording.coupling", self.coupling, joint_names)

    def torque_matrix(self, joint_names: Sequence[str]) -> Array:
        """The matrix, (J, J), of torques: C⁻ᵀ, by virtual work, unless ``torque_coupling`` is set."""
        if self.torque_coupling is None:
            return np.linalg.inv(self.motion_matrix(joint_names)).T
        return coupling_matrix("recording.torque_coupling", self.torque_coupling, joint_names)

    def coupled(self, joint_names: Sequence[str], motion: Array, torque: Array) -> str:
        """Settings for positions that are ``motion``, (J, J), times those of now, and torques likewise."""
        motion = motion @ self.motion_matrix(joint_names)
        torque = torque @ self.torque_matrix(joint_names)
        same = self.coupling is None and np.array_equal(motion, np.eye(len(motion)))
        fields = {} if same else {"coupling": coupling_rows(motion, joint_names)}
        if self.torque_coupling is not None or not np.allclose(torque, np.linalg.inv(motion).T):
            fields["torque_coupling"] = coupling_rows(torque, joint_names)
        return suggest_fields("recording", fields, ".6g")


@dataclass(frozen=True)
class Files:
    """Files of one recording, each with a signal and its time stamps."""

    position: Annotated[str, Field(min_length=1)]
    velocity: str | None = None
    acceleration: str | None = None
    torque: str | None = None
    current: str | None = None
    effort: str | None = None  # torque or current, see ``recording.effort``

    def __post_init__(self) -> None:
        if self.torque is self.current is self.effort is None:
            raise ConfigError(f"{self} has no effort, expected {{position: q.csv, effort: tau.csv}}")
        if self.effort is not None and (self.torque or self.current):
            raise ConfigError(f"{self} has both an effort and a torque or current: leave one of them out")

    def __str__(self) -> str:
        """The files as given on the command line."""
        return "{" + ", ".join(f"{name}: {path}" for name, path in vars(self).items() if path) + "}"

    def signals(self, effort: str) -> dict[str, str]:
        """Paths by signal; ``effort`` is "torque" or "current"."""
        return {effort if name == "effort" else name: path for name, path in vars(self).items() if path}


Recorded = str | Files  # a recording as it is named in the settings


def paths_of(recorded: Recorded | Path) -> list[str]:
    """Paths of a recording's files, without repetitions."""
    paths = vars(recorded).values() if isinstance(recorded, Files) else [str(recorded)]
    return [*dict.fromkeys(path for path in paths if path)]
