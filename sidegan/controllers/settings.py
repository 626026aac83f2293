"""Settings of files for controllers: config group ``controllers``."""

from dataclasses import dataclass, field
from typing import Literal

from sidegan.base.arrays import Array
from sidegan.base.settings_text import suggestion
from sidegan.base.typed import Hertz, Number, Positive, PositiveShare, Seconds
from sidegan.errors import ConfigError
from sidegan.robot import Arm
from sidegan.robot.coupling import Rows, coupling_matrix

_MOST_SAMPLES = 500_000  # of a motion: ten such trajectories of seven joints take 9 GB of memory
_CHECK_RATE = 25.0  # [Hz] at which motions are checked, however low the rate of the tables


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """Largest deviation of a joint from its command; beyond it the controller refuses or stops."""

    angle: Positive = 0.05  # of revolute joints [rad]
    length: Positive = 0.01  # of prismatic joints [m]

    def of(self, arm: Arm) -> list[float]:
        """Tolerance of each joint [rad or m], (J,)."""
        return [self.length if slides else self.angle for slides in arm.prismatic.tolist()]


@dataclass(frozen=True, kw_only=True)
class ExportSettings:
    """Files for the controllers, and how the trajectories are run."""

    formats: list[Literal["csv", "ros2", "urscript"]] = field(default_factory=lambda: ["csv", "ros2"])
    rate: Hertz = 100.0  # of the tables [Hz]
    speed: PositiveShare = 1.0  # share of the planned speed: the same paths, slower
    pause: Seconds | None = 1.0  # rest between trajectories [s]; null: none
    # joints whose position is a sum of the controller's, in whose coordinates files and ``start`` are
    coupling: Rows | None = None
    start: list[Number] | None = None  # present position [rad or m]; adds a path from there to home and back
    # share of the limits that this path uses; of torques, in addition to holding the arm
    careful: PositiveShare = 0.2
    longest: Positive = 600.0  # most time for this path [s]
    tolerance: Tolerance = Tolerance()  # at the start of a goal or program, and on the path
    rehearse: bool = False  # execute the set in MuJoCo first

    def __post_init__(self) -> None:
        if not self.formats or len(set(self.formats)) < len(self.formats):
            raise ConfigError("formats must name one or more, each once")

    def matrix(self, arm: Arm) -> Array:
        """The matrix, (J, J), of joints' positions from the controller's."""
        return coupling_matrix("controllers.coupling", self.coupling, arm.joint_names)

    def refuse_long(self, motion: str, duration: float) -> None:
        """Refuse a motion of this duration [s] that has too many samples for the memory, by a ConfigError."""
        samples = duration * max(self.rate, _CHECK_RATE)
        if samples > _MOST_SAMPLES:
            raise ConfigError(
                f"{motion} takes {duration:.4g} s, {samples:.4g} samples with "
                f"{suggestion('controllers.rate', self.rate, 'g')}, expected at most {_MOST_SAMPLES:,}"
            )
