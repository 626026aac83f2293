"""Instructions for a set's files: the next steps, as sentences and commands."""

from collections.abc import Mapping
from itertools import groupby
from pathlib import Path
from shlex import quote

from sidegan.base.names import plain
from sidegan.controllers import APPROACH, SHELL
from sidegan.pipeline.context import RunContext
from sidegan.recording.commanded import FOLDER
from sidegan.robot import changes

Steps = list[tuple[str, str]]  # a sentence and a command each

_FIRST = 0.25  # speed of the first run, as a share of the planned speed
_PER_RUN = ("controllers.speed=", "controllers.start=", "controllers.rehearse=")  # overrides not to repeat
_SLOWLY = "First slowly: the same set at a quarter of the speed, with a path from where the arm stands:"
_LOG = "Log positions and torques or currents throughout, run the whole set at least twice; then:"
_ACTION = "/joint_trajectory_controller/follow_joint_trajectory"
_GOAL = "control_msgs/action/FollowJointTrajectory"


def order_of(run: RunContext, durations: Mapping[str, float]) -> str:
    """Which files to send in which order, how long each takes, and where the arm must stand."""
    groups = [(length, [*names]) for length, names in groupby(durations, lambda name: plain(durations[name]))]
    parts = [
        f"{names[0]} ({length} s)" if len(names) == 1 else f"{names[0]} … {names[-1]} ({length} s each)"
        for length, names in groups
    ]
    return f"to be sent in this order: {', '.join(parts)}; {_place(run, durations)}"


def _place(run: RunContext, durations: Mapping[str, float]) -> str:
    """Where the arm must stand before anything is sent."""
    ways = APPROACH in durations
    q = run.cfg.controllers.start if ways else run.cell.trajectory.home or [0.0] * run.cell.arm.joints
    where = ", ".join(f"{name} {x:.6g}" for name, x in zip(run.cell.arm.joint_names, q or ()))
    if ways:
        return f"the arm must stand at controllers.start: {where}"
    return f"the arm must stand at home first: {where} (controllers.start=[…] writes a path there)"


def next_steps(run: RunContext, durations: Mapping[str, float]) -> Steps:
    """Next steps with the set, a sentence and a command each; the slow run comes first."""
    speed = run.cfg.controllers.speed
    folder = run.store.run_folder.resolve()
    pace = "at the planned speed" if speed == 1 else f"at {speed:.0%} of the planned speed"
    then = f"{'Then this set' if speed > _FIRST else 'This set'}, {pace}, {order_of(run, durations)}."
    if run.cell.arm.locked:
        then += f" Standing still: {run.cell.arm.locked}."
    slow = [(_SLOWLY, _slower(run, folder))] if speed > _FIRST else []
    return [*slow, (then, _send(run, folder / FOLDER, durations)), (_LOG, _identify(run, folder))]


def _slower(run: RunContext, folder: Path) -> str:
    """Command that writes the same set for a first run."""
    start = run.cfg.controllers.start
    where = "…" if start is None else ",".join(f"{x:.6g}" for x in start)
    kept = [override for override in run.overrides if not override.startswith(_PER_RUN)]
    new = [f"controllers.speed={_FIRST}", f"controllers.start=[{where}]", f"hydra.run.dir={folder}-slow"]
    same = " ".join(map(quote, kept)) or f"+experiment=excite {_robot(run)}"
    return f"sidegan {same} {' '.join(map(quote, new))}"


def _send(run: RunContext, folder: Path, durations: Mapping[str, float]) -> str:
    """Commands that send the goals of a set one by one, or the files if it has no goals."""
    formats = run.cfg.controllers.formats
    if "ros2" not in formats:
        ending = "script" if "urscript" in formats else "csv"
        return "\n".join(f"{folder / name}.{ending}" for name in durations)
    large = max((folder / f"{name}.yaml").stat().st_size for name in durations) >= SHELL
    goal = "--stdin < $1.yaml" if large else '"$(cat $1.yaml)"'
    needs = "  # too long for a command line: --stdin needs ROS 2 Jazzy or newer" if large else ""
    send = f"send() {{ ros2 action send_goal {_ACTION} \\\n    {_GOAL} {goal}; }}{needs}"
    return "\n".join([f"cd {quote(str(folder))}", send, *(f"send {name}" for name in durations)])


def _identify(run: RunContext, folder: Path) -> str:
    return (
        f"sidegan +experiment=identify {_robot(run)} 'recordings=[log.csv]' validation=0.25 \\\n"
        f"    recording=excite recording.sent={quote(str(folder))}"
    )


def _robot(run: RunContext) -> str:
    robot = run.cfg.robot
    return " ".join([quote(f"robot.name={robot.name}"), *changes("robot", robot.setup)])
