"""Settings of reading and preprocessing a recording, group ``recording`` of ``conf/``."""

from dataclasses import dataclass
from typing import Annotated

from sidegan.base.typed import Bound, Count, NonNegative, Positive
from sidegan.recording.columns import Columns


@dataclass(frozen=True)
class Preprocessing:
    """How a recording becomes filtered segments on a uniform grid."""

    reverse: list[str]  # joints whose torque or current is counted the other way round
    bandwidth: Positive | None  # highest frequency of the executed trajectory [Hz]; null: measured
    cutoff: Positive | None  # of the zero-phase low-pass [Hz]; null: headroom × bandwidth
    headroom: Positive  # cut-off over bandwidth
    order: Count  # of the low-pass, which is run forwards and backwards
    oversampling: Annotated[float, Bound(">", 2)]  # samples that are kept per period of the cut-off
    gap: Positive | None  # longest time that is interpolated over [s]; null: five sampling steps
    still: NonNegative  # below it a joint rests [rad/s or m/s]; 0 keeps all samples
    pause: NonNegative  # samples this close to a motion are kept [s]


@dataclass(frozen=True)
class RecordingSettings(Preprocessing, Columns):
    """What is where in a recorded file, and how it is preprocessed."""

    rows: Annotated[int, Bound("≥", 1000)]  # that are read at once
