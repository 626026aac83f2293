"""Group ``recording`` of ``conf/``: where a file keeps what, in which units, and how it is preprocessed."""

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, Literal

from pydantic import Field

from sidegan.base.typed import Hertz, NonNegative, Seconds
from sidegan.errors import ConfigError
from sidegan.recording.units import Units

SIGNALS = ("position", "velocity", "acceleration", "torque", "current")
PLACEHOLDER = re.compile(r"\{(joint|index|index0)\}")
AUTO = "auto"  # in the place of a pattern: what columns are called tells what they hold


@dataclass(frozen=True, kw_only=True)
class RecordingSettings:
    """Where a file keeps time and signals, what is known of its making, and how it is preprocessed.

    A signal is a pattern with ``{joint}`` (the joint's name), ``{index}`` (from 1) or ``{index0}`` (from
    0), the name of one array (S, J), or ``auto``; what stands between bars is tried one after another. A
    pattern that is set has to be there, and so has position; of what is found by its names, what a file does
    not have is left out, but a signal of some joints only is refused.
    """

    time: str = AUTO
    position: str = AUTO
    velocity: str | None = AUTO
    acceleration: str | None = AUTO
    torque: str | None = AUTO
    current: str | None = AUTO
    units: Units = Units()
    joints: list[str] | None = None  # names that the file uses, in the arm's order; null: the arm's own
    # joints without a torque, which stand still: they are locked where they stand
    without: list[str] = field(default_factory=list)
    topic: str | None = None  # of a bag; null: the only topic of joint states
    effort: Literal["torque", "current"] = "torque"  # what is meant by efforts
    rate: Hertz | None = None  # of the rows [Hz] of a file without time stamps
    # joints whose torque or current is counted the other way round
    reverse: list[str] = field(default_factory=list)
    cutoff: Hertz | None = None  # of the zero-phase low-pass [Hz]; null: twelve times the motion's bandwidth
    # longest time that is interpolated over [s]; null: five samples, or a quarter of the cut-off's period
    gap: Seconds | None = None
    still: NonNegative = 0.02  # below it a joint rests [rad/s or m/s]; 0 keeps all samples
    # time by which torques are later than states [s], which is taken off; null: measured
    delay: Annotated[float, Field(ge=-2, le=2)] | None = 0.0
    # what was sent to the arm: a table of excite, or the folder of its run; null: not known
    sent: str | None = None

    def __post_init__(self) -> None:
        for signal in SIGNALS:
            pattern = getattr(self, signal)
            if pattern is not None and re.search(r"[{}]", PLACEHOLDER.sub("", pattern)):
                raise ConfigError(
                    f"{signal} is {pattern!r}, expected only {{joint}}, {{index}} and {{index0}} in braces"
                )


@dataclass(frozen=True)
class Files:
    """Files of one recording: of each a signal and its time stamps are read."""

    position: str
    velocity: str | None = None
    acceleration: str | None = None
    torque: str | None = None
    current: str | None = None
    effort: str | None = None  # torque or current, as ``recording.effort`` says

    def __post_init__(self) -> None:
        if self.torque is self.current is self.effort is None:
            raise ConfigError(f"{self} has no effort, expected {{position: q.csv, effort: tau.csv}}")
        if self.effort is not None and (self.torque or self.current):
            raise ConfigError(f"{self} has both an effort and a torque or current: leave one of them out")

    def __str__(self) -> str:
        """As they are given on the command line."""
        return "{" + ", ".join(f"{name}: {path}" for name, path in vars(self).items() if path) + "}"

    def signals(self, effort: str) -> dict[str, str]:
        """Paths by signal, where efforts are torques or currents."""
        return {effort if name == "effort" else name: path for name, path in vars(self).items() if path}


Recorded = str | Files  # a recording as it is named in the settings


def paths_of(recorded: Recorded | Path) -> list[str]:
    """Paths of a recording's files, each once."""
    paths = vars(recorded).values() if isinstance(recorded, Files) else [str(recorded)]
    return [*dict.fromkeys(path for path in paths if path)]
