"""Group ``controllers`` of ``conf/``: how trajectories are handed to robots."""

from dataclasses import dataclass, field
from typing import Literal

from sidegan.base.typed import Hertz, Number, Part, Positive, Seconds
from sidegan.errors import ConfigError
from sidegan.robot import Arm


@dataclass(frozen=True, kw_only=True)
class Tolerance:
    """Distance of a joint from what it is sent, beyond which the controller refuses or stops."""

    angle: Positive = 0.05  # [rad]
    length: Positive = 0.01  # [m], of joints that slide

    def of(self, arm: Arm) -> list[float]:
        """That of each joint [rad or m], (J,)."""
        return [self.length if slides else self.angle for slides in arm.prismatic.tolist()]


@dataclass(frozen=True, kw_only=True)
class ExportSettings:
    """Files for the controllers, and how the trajectories are run."""

    formats: list[Literal["csv", "ros2", "urscript"]] = field(default_factory=lambda: ["csv", "ros2"])
    rate: Hertz = 100.0  # of the tables [Hz]
    speed: Part = 1.0  # share of the planned speed: the same paths, slower
    pause: Seconds | None = 1.0  # at rest between two trajectories [s]; null: none
    # where the arm is now [rad or m]: the way from there to home and back is written too
    start: list[Number] | None = None
    # share of the limits that this way uses; of torques, beside what holds the arm
    careful: Part = 0.2
    longest: Positive = 600.0  # that this way may take [s]
    # beyond which an arm is not where a goal or a program begins, or does not follow
    tolerance: Tolerance = Tolerance()
    rehearse: bool = False  # execute the set in MuJoCo first

    def __post_init__(self) -> None:
        if not self.formats or len(set(self.formats)) < len(self.formats):
            raise ConfigError("formats must name one or more, each once")
