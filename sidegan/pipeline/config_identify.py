"""The part of the schema of ``conf/`` that is about identifying an arm from recordings."""

from dataclasses import dataclass
from typing import Annotated, Literal

from sidegan.base.typed import Bound, Count, NonNegative, Positive
from sidegan.errors import ConfigError


@dataclass(frozen=True)
class Units:
    """Units of a recording."""

    time: Literal["s", "ms", "us", "ns"]
    angle: Literal["rad", "deg"]
    torque: Literal["N·m", "Nm", "mNm"]
    current: Literal["A", "mA"]


@dataclass(frozen=True)
class Recording:
    """What is where in a recording, and how it is conditioned."""

    time: str
    position: str
    velocity: str | None
    acceleration: str | None
    torque: str | None
    current: str | None
    units: Units
    joints: list[str] | None  # names that the file uses, in the arm's order; null: the arm's own
    topic: str | None  # of a bag
    effort: Literal["torque", "current"]
    reverse: list[str]  # joints whose torque or current is counted the other way round
    bandwidth: Positive | None  # [Hz]; null: measured
    cutoff: Positive | None  # [Hz]; null: headroom × bandwidth
    headroom: Positive
    order: Count
    oversampling: Annotated[float, Bound(">", 2)]
    gap: Positive | None  # [s]; null: five sampling steps
    still: NonNegative  # [rad/s or m/s]
    pause: NonNegative  # [s]
    rows: Annotated[int, Bound("≥", 1000)]  # that are read at once


def check_files(recordings: list[str], validation: list[str]) -> None:
    """Refuse a recording that is named twice, or that a model would be validated on after training.

    Raises:
        ConfigError: naming the file.
    """
    for name, files in (("recordings", recordings), ("validation", validation)):
        twice = [file for file in files if files.count(file) > 1]
        if twice:
            raise ConfigError(f"{name} has {twice[0]} twice")
    both = [file for file in validation if file in recordings]
    if both:
        raise ConfigError(f"validation has {both[0]}, which is in recordings: it would not be held out")
