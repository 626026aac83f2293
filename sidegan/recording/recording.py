"""A recording as it was made, and segments of it after preprocessing."""

from dataclasses import dataclass
from typing import Literal, NamedTuple

from sidegan.base.arrays import Array
from sidegan.errors import RecordingError
from sidegan.recording.settings import SIGNALS

SIGN_WIDTH = 0.01  # [rad/s or m/s] at which the smooth sign of a velocity is at 76 %


@dataclass(frozen=True, eq=False)
class Recording:
    """S samples of a J-joint arm as recorded, float64 in SI units; rows without a number are out."""

    name: str  # for people, the file's name
    joint_names: tuple[str, ...]  # of the arm, in its order
    time: Array  # stamps [s], (S,), in the order of the file: jitter, duplicates and gaps are still in
    position: Array  # [rad or m], (S, J)
    velocity: Array | None = None  # [rad/s or m/s], (S, J), where recorded
    acceleration: Array | None = None  # [rad/s² or m/s²], (S, J), where recorded
    torque: Array | None = None  # [N·m or N], (S, J), where recorded
    current: Array | None = None  # of the motors [A], (S, J), where recorded
    # row (the header is row 1 of a text file, otherwise counted from 1) and reason of what was left out
    corrupt: tuple[tuple[int, str], ...] = ()
    remarks: tuple[str, ...] = ()  # for people, on which columns it was read from

    def __len__(self) -> int:
        return len(self.time)

    def signals(self) -> dict[str, Array]:
        """The signals that were recorded, by name, (S, J) each."""
        signals = {name: getattr(self, name) for name in SIGNALS}
        return {name: x for name, x in signals.items() if x is not None}

    @property
    def load(self) -> Literal["torque", "current"]:
        """Which of both the arm is identified from: torques where there are any."""
        if self.torque is self.current is None:
            raise RecordingError(f"{self.name} has neither torque nor current")
        return "current" if self.torque is None else "torque"


class Segment(NamedTuple):
    """A stretch without gaps on a uniform grid, filtered: time (S,) [s], the others (S, J) in SI units.

    ``sign`` is the smooth sign of the velocity after the low-pass that the torque went through.
    """

    time: Array
    position: Array
    velocity: Array
    acceleration: Array
    torque: Array
    sign: Array
