"""Write the controller files of a set of trajectories."""

from itertools import count
from pathlib import Path

from sidegan.base.arrays import Array
from sidegan.base.settings_text import suggestion
from sidegan.base.storage import replacing_folder, write_bytes
from sidegan.controllers.course import POINTS, Course, approach, least_rate, run_of
from sidegan.controllers.formats import SCRIPTED, csv_text, goal_text, script_text
from sidegan.controllers.settings import ExportSettings
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, check
from sidegan.validity.home import refuse_degrees

ALL, APPROACH, RETURN = "all", "approach", "return"
_PRINTED = 1e-4  # relative rounding of a rate in a message
_ENDINGS = (".csv", ".yaml", ".script")


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
    _refuse_invalid(constraints, trajectory, c)
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
        ways[APPROACH] = approach(constraints, start, home, settings).for_controller(matrix)
        ways[RETURN] = approach(constraints, home, start, settings).for_controller(matrix)
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
    former = _of_earlier_runs(folder)
    with replacing_folder(folder, lambda path: path.name in former) as new:
        for name, text in texts.items():
            write_bytes(new / name, text.encode())
    return {name: goals[name].duration for name in (APPROACH, *points, RETURN) if name in goals}


def _refuse_invalid(constraints: Constraints, trajectory: Trajectory, c: Array) -> None:
    """Refuse a set that is empty or has invalid trajectories, by an InfeasibleError."""
    if not len(c):
        raise InfeasibleError("the set has no trajectories")
    found = check(constraints, trajectory, c)
    if not found.valid.all():
        first = int(found.valid.argmin())
        raise InfeasibleError(
            f"{int((~found.valid).sum())} of {len(c)} trajectories are invalid: {first + 1} violates "
            f"{found.failures(first)[0]}; no files are written"
        )


def require_exportable(arm: Arm, trajectory: Trajectory, settings: ExportSettings) -> None:
    """Refuse settings that do not fit an arm, or a family at its final speed, by a ConfigError."""
    matrix, least = settings.matrix(arm), least_rate(trajectory)
    if "csv" in settings.formats and settings.rate < least * (1 - _PRINTED):
        raise ConfigError(
            f"controllers.rate is {settings.rate:g} Hz, expected {least:.5g} or more: {POINTS} points per "
            f"period of the highest of {suggestion('trajectory.harmonics', trajectory.harmonics)}"
        )
    period = suggestion("trajectory.period", trajectory.period * settings.speed, "g")
    speed = suggestion("controllers.speed", settings.speed, "g")
    settings.refuse_long(f"a trajectory of {period}, {speed}", trajectory.period)
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
        refuse_degrees(arm, settings.start, "controllers.start", matrix)


def _of_earlier_runs(folder: Path) -> set[str]:
    """Names of the files that earlier runs left in a folder; their trajectories are 1, 2, … without a gap."""
    files = [path for path in folder.glob("*") if path.suffix in _ENDINGS]
    numbers = {path.name: int(path.stem) for path in files if path.stem.isdecimal()}
    gap = next(number for number in count(1) if number not in numbers.values())
    trajectories = {name for name, number in numbers.items() if 1 <= number < gap}
    return trajectories | {path.name for path in files if path.stem in (ALL, APPROACH, RETURN)}
