"""The files of a set of trajectories, one for each controller that was asked for."""

from collections.abc import Sequence
from pathlib import Path

from torch import Tensor

from sidegan.base.storage import write_bytes
from sidegan.controllers.approach import approach
from sidegan.controllers.course import Course, knots, run_of
from sidegan.controllers.ros2 import goal_text, write_mcap
from sidegan.controllers.settings import Delivery
from sidegan.controllers.table import csv_text
from sidegan.controllers.urscript import script_text
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints

_ALL = "all"


def deliver(
    constraints: Constraints, trajectory: Trajectory, c: Tensor, settings: Delivery, folder: Path
) -> None:
    """Write trajectories (n, J, H, 2) for controllers: ``1.csv`` …, ``all.csv``, and so on.

    Goals for ROS 2 are of one trajectory each, an MCAP holds all of them, and programs and tables are both.
    Where it is known where the arm is, ``approach`` is the way to home and ``return`` the way back.

    Raises:
        ShapeError: when there is no trajectory, or URScript is asked for and the joints are not six.
        InfeasibleError: when the straight way from where the arm is to home is not free.
        StorageError: when a file cannot be written.
    """
    digits, pause, joints = len(str(len(c))), settings.pause or 0.0, constraints.arm.joint_names
    names = [f"{k + 1:0{digits}}" for k in range(len(c))]

    def courses(times: Tensor) -> dict[str, Course]:
        each = (Course.of(joints, trajectory.roll_out(one[None], times)) for one in c)
        return {name: course.slowed(settings.speed) for name, course in zip(names, each)}

    points, ways = courses(knots(trajectory)), _ways(constraints, trajectory, settings)
    fine = courses(trajectory.times(settings.rate / settings.speed)) if "csv" in settings.formats else {}
    fine = fine | {name: way.sampled(settings.rate) for name, way in ways.items()}
    _write(settings.formats, (points, fine, ways), pause, folder)


def _ways(constraints: Constraints, trajectory: Trajectory, settings: Delivery) -> dict[str, Course]:
    """The way from where the arm is to home, and back; nothing where that is not known."""
    if settings.start is None:
        return {}
    home = tuple(trajectory.home or ())
    ends = {"approach": (settings.start, home), "return": (home, settings.start)}
    return {name: approach(constraints, *both, settings.careful) for name, both in ends.items()}


def _write(
    formats: Sequence[str], courses: tuple[dict[str, Course], ...], pause: float, folder: Path
) -> None:
    """Write courses of few points, of many, and the ways to home and back."""
    points, fine, ways = courses
    if "csv" in formats:
        in_a_row = run_of([one for name, one in fine.items() if name not in ways], pause)
        for name, course in (fine | {_ALL: in_a_row}).items():
            write_bytes(folder / f"{name}.csv", csv_text(course).encode())
    if "ros2" in formats:
        for name, course in (points | ways).items():
            write_bytes(folder / f"{name}.yaml", goal_text(course).encode())
    if "mcap" in formats:
        named = {f"trajectory_{name}": one for name, one in points.items()} | ways
        write_mcap(named, folder / f"{_ALL}.mcap")
    if "urscript" in formats:
        for name, course in (points | ways | {_ALL: run_of([*points.values()], pause)}).items():
            write_bytes(folder / f"{name}.script", script_text(course, f"excite_{name}").encode())
