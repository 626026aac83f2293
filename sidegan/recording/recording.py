"""A raw recording, and its segments after preprocessing."""

from dataclasses import dataclass, replace
from typing import Any, Literal, NamedTuple

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.recording.settings import SIGNALS
from sidegan.recording.units import Units

SIGN_WIDTH = 0.01  # [rad/s or m/s] at which the smooth sign of a velocity is at 76 %


@dataclass(frozen=True, eq=False)
class Recording:
    """S samples of a J-joint arm as recorded, float64 in SI units, without corrupt rows."""

    name: str  # for people, the file's name
    joint_names: tuple[str, ...]  # of the arm, in its order
    time: Array  # stamps [s], (S,), in the order of the file: jitter, duplicates and gaps are still in
    position: Array  # [rad or m], (S, J)
    velocity: Array | None = None  # [rad/s or m/s], (S, J), where recorded
    acceleration: Array | None = None  # [rad/s² or m/s²], (S, J), where recorded
    torque: Array | None = None  # [N·m or N], (S, J), where recorded
    current: Array | None = None  # of the motors [A], (S, J), where recorded
    # row number (from 1; of text files from the header) and reason of each corrupt row
    corrupt: tuple[tuple[int, str], ...] = ()
    remarks: tuple[str, ...] = ()  # for people, on how it was read
    units: Units | None = None  # in which the file was read; None: those of the settings

    def __len__(self) -> int:
        return len(self.time)

    def signals(self) -> dict[str, Array]:
        """Recorded signals by name, (S, J) each."""
        signals = {name: getattr(self, name) for name in SIGNALS}
        return {name: x for name, x in signals.items() if x is not None}

    def take(self, rows: Array | slice | list[int]) -> "Recording":
        """Some of its samples."""
        signals: dict[str, Any] = {name: x[rows] for name, x in self.signals().items()}
        return replace(self, time=self.time[rows], **signals)

    @property
    def load(self) -> Literal["torque", "current"]:
        """Signal from which the arm is identified: torque if it was recorded, otherwise current."""
        if self.torque is self.current is None:
            raise RecordingError(f"{self.name} has neither torque nor current")
        return "current" if self.torque is None else "torque"


class Segment(NamedTuple):
    """A filtered stretch without gaps on a uniform grid: time (S,) [s], the others (S, J) in SI units.

    ``sign`` is the smooth sign of the velocity, passed through the same low-pass as the torque.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    sign: Array
