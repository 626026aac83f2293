"""Write the controller files of a set of trajectories; their settings: config group ``controllers``."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal

from sidegan.base.arrays import Array
from sidegan.base.storage import replacing_folder, write_bytes
from sidegan.base.typed import Hertz, Number, Part, Positive, Seconds
from sidegan.controllers.course import POINTS, Course, approach, least_rate, run_of
from sidegan.controllers.formats import SCRIPTED, csv_text, goal_text, script_text
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.robot.coupling import Rows, coupling_matrix
from sidegan.validity import Constraints, check
from sidegan.validity.home import refuse_degrees

ALL, APPROACH, RETURN = "all", "approach", "return"
_PRINTED = 1e-4  # relative rounding of a rate in a message
_ENDINGS = (".csv", ".yaml", ".script")
_MOST = 500_000  # samples of a motion: ten such trajectories of seven joints take 9 GB of memory
_LEAST = 25.0  # [Hz] rate at which motions are checked, however low that of the tables


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
    speed: Part = 1.0  # share of the planned speed: the same paths, slower
    pause: Seconds | None = 1.0  # rest between trajectories [s]; null: none
    # joints whose position is a sum of the controller's, in whose coordinates files and ``start`` are
    coupling: Rows | None = None
    start: list[Number] | None = None  # present position [rad or m]; adds a path from there to home and back
    careful: Part = 0.2  # share of the limits that this path uses; of torques, in addition to holding the arm
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
        samples = duration * max(self.rate, _LEAST)
        if samples > _MOST:
            raise ConfigError(
                f"{motion} takes {duration:.4g} s, {samples:.4g} samples with "
                f"controllers.rate={self.rate:g}, expected at most {_MOST:,}"
            )


def export_set(
    constraints: Constraints, trajectory: Trajectory, c: Array, settings: ExportSettings, folder: Path
) -> dict[str, float]:
    """Write files for trajectories (n, J, H, 2) at their final speed: ``1.csv`` …, ``all.csv``, and so on.

    ROS 2 goals have a trajectory each; there are programs and tables for each trajectory and for all in
    sequence. If the arm's position is known, ``approach`` is the path to home and ``return`` the path back.
    The files replace those of an earlier run; other files in the folder stay.

    Returns:
        Duration [s] of each file, by name, in the order in which to send them.

    Raises:
        ConfigError: when the settings do not fit the arm or the trajectories.
        InfeasibleError: when a trajectory is invalid, or the straight path from the arm's position to home
            is not free, or too long.
        StorageError: when a file cannot be written.
    """
    require_exportable(constraints.arm, trajectory, settings)
    if not len(c):
        raise InfeasibleError("the set has no trajectories")
    found = check(constraints, trajectory, c)
    if not found.valid.all():
        first = int(found.valid.argmin())
        raise InfeasibleError(
            f"{int((~found.valid).sum())} of {len(c)} trajectories are invalid: {first + 1} violates "
            f"{found.failures(first)[0]}; no files are written"
        )
    arm, rate, digits = constraints.arm, settings.rate, len(str(len(c)))
    matrix = settings.matrix(arm)

    def courses(times: Array) -> dict[str, Course]:
        """Each trajectory with points at these times [s], by its number."""
        motions = (trajectory.roll_out(coefficients[None], times) for coefficients in c)
        made = (Course.of(arm.joint_names, motion).for_controller(matrix) for motion in motions)
        return {f"{k:0{digits}}": course for k, course in enumerate(made, 1)}

    points = courses(trajectory.times(least_rate(trajectory)))
    ways: dict[str, Course] = {}
    if settings.start is not None:
        home = tuple(trajectory.home or ())
        start = (matrix @ settings.start).tolist()
        ends = {APPROACH: (start, home), RETURN: (home, start)}
        for name, both in ends.items():
            ways[name] = approach(constraints, *both, settings).for_controller(matrix)
    goals = points | ways
    pause = settings.pause or 0.0
    texts: dict[str, str] = {}
    if "csv" in settings.formats:
        tables = courses(trajectory.times(rate))
        tables |= {ALL: run_of(tables.values(), pause, rate)}
        tables |= {name: way.sampled(rate) for name, way in ways.items()}
        texts |= {f"{name}.csv": csv_text(course) for name, course in tables.items()}
    if "ros2" in settings.formats:
        near = settings.tolerance.of(arm)
        texts |= {f"{name}.yaml": goal_text(course, near, arm.locked) for name, course in goals.items()}
    if "urscript" in settings.formats:
        angle = settings.tolerance.angle
        for name, course in (goals | {ALL: run_of(points.values(), pause)}).items():
            texts[f"{name}.script"] = script_text(course, f"excite_{name}", angle, arm.locked)
    with replacing_folder(folder, _of_a_run) as new:
        for name, text in texts.items():
            write_bytes(new / name, text.encode())
    return {name: goals[name].duration for name in (APPROACH, *points, RETURN) if name in goals}


def require_exportable(arm: Arm, trajectory: Trajectory, settings: ExportSettings) -> None:
    """Refuse settings that do not fit an arm, or a family at its final speed, by a ConfigError."""
    matrix, least = settings.matrix(arm), least_rate(trajectory)
    if "csv" in settings.formats and settings.rate < least * (1 - _PRINTED):
        raise ConfigError(
            f"controllers.rate is {settings.rate:g} Hz, expected {least:.5g} or more: {POINTS} points per "
            f"period of the highest of trajectory.harmonics={trajectory.harmonics}"
        )
    planned = f"trajectory.period={trajectory.period * settings.speed:g}, controllers.speed"
    settings.refuse_long(f"a trajectory of {planned}={settings.speed:g}", trajectory.period)
    settings.refuse_long("controllers.pause", settings.pause or 0.0)
    slides = arm.prismatic
    if "urscript" in settings.formats and (arm.joints != SCRIPTED or slides.any()):
        sliding = f" (prismatic: {arm.named(slides)})" if slides.any() else ""
        raise ConfigError(
            f"controllers.formats has urscript, which moves {SCRIPTED} revolute joints; "
            f"{arm.name} has {arm.joints}{sliding}"
        )
    if settings.start is not None:
        if len(settings.start) != arm.joints:
            raise ConfigError(
                f"controllers.start is {settings.start}, expected the positions of {arm.joints} joints, "
                f"{', '.join(arm.joint_names)}"
            )
        refuse_degrees(arm, (matrix @ settings.start).tolist(), "controllers.start")


def _of_a_run(path: Path) -> bool:
    """Whether a run writes files of this name."""
    named = path.stem.isdigit() or path.stem in (ALL, APPROACH, RETURN)
    return named and path.suffix in _ENDINGS
