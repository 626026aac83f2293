"""The files of a set of trajectories, one for each controller that was asked for."""

from collections.abc import Sequence
from pathlib import Path

from torch import Tensor

from sidegan.base.storage import write_bytes
from sidegan.controllers.course import Course, knots, run_of
from sidegan.controllers.ros2 import goal_text, write_mcap
from sidegan.controllers.settings import Delivery
from sidegan.controllers.table import csv_text
from sidegan.controllers.urscript import script_text
from sidegan.motion.trajectory import Trajectory

_ALL = "all"


def deliver(
    trajectory: Trajectory, c: Tensor, joint_names: Sequence[str], settings: Delivery, folder: Path
) -> None:
    """Write trajectories (n, J, H, 2) for controllers: ``1.csv`` …, ``all.csv``, and so on.

    Goals for ROS 2 are of one trajectory each, an MCAP holds all of them, and programs and tables are both.

    Raises:
        ShapeError: when there is no trajectory, or URScript is asked for and the joints are not six.
        StorageError: when a file cannot be written.
    """
    digits, pause = len(str(len(c))), settings.pause or 0.0
    names = [f"{k + 1:0{digits}}" for k in range(len(c))]

    def courses(times: Tensor) -> dict[str, Course]:
        each = (Course.of(joint_names, trajectory.roll_out(one[None], times)) for one in c)
        return {name: course.slowed(settings.speed) for name, course in zip(names, each)}

    points = courses(knots(trajectory))
    in_a_row = points | {_ALL: run_of([*points.values()], pause)}
    if "csv" in settings.formats:
        fine = courses(trajectory.times(settings.rate / settings.speed))
        for name, course in (fine | {_ALL: run_of([*fine.values()], pause)}).items():
            write_bytes(folder / f"{name}.csv", csv_text(course).encode())
    if "ros2" in settings.formats:
        for name, course in points.items():
            write_bytes(folder / f"{name}.yaml", goal_text(course).encode())
    if "mcap" in settings.formats:
        write_mcap({f"trajectory_{name}": one for name, one in points.items()}, folder / f"{_ALL}.mcap")
    if "urscript" in settings.formats:
        for name, course in in_a_row.items():
            write_bytes(folder / f"{name}.script", script_text(course, f"excite_{name}").encode())
