"""The files of a set of trajectories, one for each controller that was asked for."""

from pathlib import Path

from torch import Tensor

from sidegan.base.storage import write_bytes
from sidegan.controllers.approach import approach
from sidegan.controllers.course import Course, knots, run_of
from sidegan.controllers.ros2 import goal_text
from sidegan.controllers.settings import Delivery
from sidegan.controllers.table import csv_text
from sidegan.controllers.urscript import script_text
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_ALL = "all"


def deliver(
    constraints: Constraints, trajectory: Trajectory, c: Tensor, settings: Delivery, folder: Path
) -> None:
    """Write trajectories (n, J, H, 2), as they are to be run: ``1.csv`` …, ``all.csv``, and so on.

    Goals for ROS 2 are of one trajectory each, programs and tables of each and of all in a row.
    Where it is known where the arm is, ``approach`` is the way to home and ``return`` the way back.

    Raises:
        InfeasibleError: when the straight way from where the arm is to home is not free.
        StorageError: when a file cannot be written.
    """
    digits, pause, joints = len(str(len(c))), settings.pause or 0.0, constraints.arm.joint_names

    def courses(times: Tensor) -> dict[str, Course]:
        """Each trajectory with points at these times [s], by its number."""
        each = [Course.of(joints, trajectory.roll_out(one[None], times)) for one in c]
        return {f"{k + 1:0{digits}}": course for k, course in enumerate(each)}

    points, ways = courses(knots(trajectory)), _ways(constraints, trajectory, settings)
    if "csv" in settings.formats:
        fine = courses(trajectory.times(settings.rate))
        fine |= {_ALL: run_of([*fine.values()], pause)}
        fine |= {name: way.sampled(settings.rate) for name, way in ways.items()}
        for name, course in fine.items():
            write_bytes(folder / f"{name}.csv", csv_text(course).encode())
    if "ros2" in settings.formats:
        for name, course in (points | ways).items():
            write_bytes(folder / f"{name}.yaml", goal_text(course).encode())
    if "urscript" in settings.formats:
        for name, course in (points | ways | {_ALL: run_of([*points.values()], pause)}).items():
            write_bytes(folder / f"{name}.script", script_text(course, f"excite_{name}").encode())


def _ways(constraints: Constraints, trajectory: Trajectory, settings: Delivery) -> dict[str, Course]:
    """The way from where the arm is to home, and back; nothing where that is not known."""
    if settings.start is None:
        return {}
    home = tuple(trajectory.home or ())
    ends = {"approach": (settings.start, home), "return": (home, settings.start)}
    return {name: approach(constraints, *both, settings.careful) for name, both in ends.items()}
