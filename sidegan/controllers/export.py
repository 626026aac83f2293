"""The files of a set of trajectories, one for each controller that was asked for."""

from collections.abc import Iterator
from pathlib import Path

from sidegan.base.arrays import Array
from sidegan.base.storage import replacing_folder, write_bytes
from sidegan.controllers.approach import approach
from sidegan.controllers.course import Course, knots, run_of
from sidegan.controllers.ros2 import goal_text
from sidegan.controllers.settings import ExportSettings
from sidegan.controllers.table import csv_text
from sidegan.controllers.urscript import script_text
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

ALL, APPROACH, RETURN = "all", "approach", "return"
_ENDINGS = (".csv", ".yaml", ".script")


def export_set(
    constraints: Constraints, trajectory: Trajectory, c: Array, settings: ExportSettings, folder: Path
) -> dict[str, float]:
    """Write trajectories (n, J, H, 2), as they are to be run: ``1.csv`` …, ``all.csv``, and so on.

    Goals for ROS 2 are of one trajectory each, programs and tables of each and of all in a row.
    Where it is known where the arm is, ``approach`` is the way to home and ``return`` the way back. The files
    take the place of all that an earlier run left; what is no file of a run stays.

    Returns:
        Duration [s] of each file, by its name, in the order in which they are to be sent.

    Raises:
        InfeasibleError: when the straight way from where the arm is to home is not free, or too long.
        StorageError: when a file cannot be written.
    """
    digits, joints = len(str(len(c))), constraints.arm.joint_names

    def courses(times: Array) -> dict[str, Course]:
        """Each trajectory with points at these times [s], by its number."""
        each = [Course.of(joints, trajectory.roll_out(one[None], times)) for one in c]
        return {f"{k + 1:0{digits}}": course for k, course in enumerate(each)}

    points, ways = courses(knots(trajectory)), _ways(constraints, trajectory, settings)
    fine = courses(trajectory.times(settings.rate)) if "csv" in settings.formats else {}
    with replacing_folder(folder, _of_a_run) as new:
        for name, content in _files(constraints, points, fine, ways, settings):
            write_bytes(new / name, content.encode())
    order = [name for name in (APPROACH, *points, RETURN) if name in points | ways]
    return {name: (points | ways)[name].duration for name in order}


def _files(
    constraints: Constraints,
    points: dict[str, Course],
    fine: dict[str, Course],
    ways: dict[str, Course],
    settings: ExportSettings,
) -> Iterator[tuple[str, str]]:
    """Name and content of each file."""
    pause, rate, notes = settings.pause or 0.0, settings.rate, constraints.arm.locked
    if "csv" in settings.formats:
        tables = fine | {ALL: run_of(fine.values(), pause, rate)}
        for name, course in (tables | {name: way.sampled(rate) for name, way in ways.items()}).items():
            yield f"{name}.csv", csv_text(course)
    if "ros2" in settings.formats:
        tolerance = settings.tolerance.of(constraints.arm)
        for name, course in (points | ways).items():
            yield f"{name}.yaml", goal_text(course, tolerance, notes)
    if "urscript" in settings.formats:
        for name, course in (points | ways | {ALL: run_of(points.values(), pause)}).items():
            yield f"{name}.script", script_text(course, f"excite_{name}", settings.tolerance.angle, notes)


def _of_a_run(path: Path) -> bool:
    """Whether a file is one that a run writes."""
    named = path.stem.isdigit() or path.stem in (ALL, APPROACH, RETURN)
    return named and path.suffix in _ENDINGS


def _ways(constraints: Constraints, trajectory: Trajectory, settings: ExportSettings) -> dict[str, Course]:
    """The way from where the arm is to home, and back; nothing where that is not known."""
    if settings.start is None:
        return {}
    home = tuple(trajectory.home or ())
    ends = {APPROACH: (settings.start, home), RETURN: (home, settings.start)}
    return {name: approach(constraints, *both, settings) for name, both in ends.items()}
