"""The files of a set of trajectories, one for each controller that was asked for."""

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
    joints = constraints.arm.joint_names
    notes = constraints.arm.locked
    rate = settings.rate
    digits = len(str(len(c)))

    def courses(times: Array) -> dict[str, Course]:
        """Each trajectory with points at these times [s], by its number."""
        each = [Course.of(joints, trajectory.roll_out(one[None], times)) for one in c]
        return {f"{k + 1:0{digits}}": course for k, course in enumerate(each)}

    points = courses(knots(trajectory))
    ways = _ways(constraints, trajectory, settings)
    pause = settings.pause or 0.0
    with replacing_folder(folder, _of_a_run) as new:
        if "csv" in settings.formats:
            tables = courses(trajectory.times(rate))
            tables |= {ALL: run_of(tables.values(), pause, rate)}
            tables |= {name: way.sampled(rate) for name, way in ways.items()}
            for name, course in tables.items():
                write_bytes(new / f"{name}.csv", csv_text(course).encode())
        if "ros2" in settings.formats:
            tolerance = settings.tolerance.of(constraints.arm)
            for name, course in (points | ways).items():
                write_bytes(new / f"{name}.yaml", goal_text(course, tolerance, notes).encode())
        if "urscript" in settings.formats:
            near = settings.tolerance.angle
            for name, course in (points | ways | {ALL: run_of(points.values(), pause)}).items():
                script = script_text(course, f"excite_{name}", near, notes)
                write_bytes(new / f"{name}.script", script.encode())
    order = [name for name in (APPROACH, *points, RETURN) if name in points | ways]
    return {name: (points | ways)[name].duration for name in order}


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
