"""The command ``python -m benchmarks.arms``: what becomes of arms that people own, as docs/arms.md.

Each arm is loaded from its stock description, refusals' own remedies followed; its shapes are compared with
coal on the original meshes; a set is made by ``+experiment=excite``; and every trajectory of it is checked at
1 kHz by ``benchmarks.independent``. What is done is kept: a run that was stopped goes on where it was.
"""

import argparse
import json
import resource
import subprocess
import sys
import time
from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path
from shlex import quote
from typing import Any

import numpy as np
import pandas as pd
import torch
import yaml

from benchmarks.independent import Facts, Robot, check_folder
from benchmarks.remedies import remedied
from benchmarks.run import machine
from benchmarks.timing import medians
from sidegan.base.storage import write_bytes
from sidegan.errors import SideganError
from sidegan.library import Library
from sidegan.pipeline.run import composed
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import LIBRARY, Task
from sidegan.report.document import template
from sidegan.report.export import markdown
from sidegan.validity import Plane

ARMS: dict[str, dict[str, Any]] = yaml.safe_load(Path(__file__).with_name("arms.yaml").read_text("utf-8"))
PAGE = Path("docs/arms.md")

_ROBOTS = "cmeel.prefix/share/example-robot-data/robots"
_CONFIGURATIONS = 2_000  # random ones, that shapes are compared in
_TIMED, _REPEATS = 350, 3  # trajectories whose check is timed, and how often
_RATE = 1_000.0  # [Hz] at which trajectories are checked
_LINES = 3  # of what a run said last, where it failed


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 0 where every arm has a set, all of it valid."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.arms", description=__doc__)
    parser.add_argument("--arms", nargs="+", choices=ARMS, default=list(ARMS), metavar="NAME")
    parser.add_argument("--work", type=Path, default=Path("outputs/arms"), help="where all of it goes")
    parser.add_argument("--page", type=Path, default=PAGE, help=f"the page (default {PAGE})")
    parser.add_argument("--fresh", action="store_true", help="begin again")
    parser.add_argument(
        "--descriptions", type=Path, help="folder of those that are not in example-robot-data"
    )
    parser.add_argument("--set", nargs="*", default=[], metavar="WORD", help="more settings of the runs")
    options = parser.parse_args(arguments)
    for number, name in enumerate(options.arms, 1):
        if "wheel" in ARMS[name] and options.descriptions is None:
            continue
        file = options.work / f"{name}.json"
        if options.fresh:
            file.unlink(missing_ok=True)
        sys.stderr.write(f"{name}, {number} of {len(options.arms)}\n")
        _measure(name, options.work / name, file, options.set, options.descriptions)
        write_bytes(options.page, page(options.work).encode())
    files = [options.work / f"{name}.json" for name in options.arms]
    results = [json.loads(file.read_text("utf-8")) for file in files if file.exists()]
    return 0 if all(_is_well(one) for one in results) else 1


def _measure(name: str, work: Path, file: Path, more: Sequence[str], folder: Path | None) -> None:
    """Do what is not done yet for an arm, and keep each part as soon as it is."""
    result: dict[str, Any] = json.loads(file.read_text("utf-8")) if file.exists() else {"name": name}
    urdf = robot_file(name, folder)
    parts: dict[str, Callable[[], dict[str, Any]]] = {
        "loaded": lambda: _load(urdf, ARMS[name].get("words", [])),
        "shapes": lambda: _compare(urdf, result["loaded"]["words"]),
        "set": lambda: _excite(urdf, result["loaded"]["words"], work, more),
        "rate": lambda: _rate(urdf, result["loaded"]["words"], work, more),
        "independent": lambda: _check(urdf, result["loaded"]["words"], work, more),
    }
    for part, do in parts.items():
        if part in result:
            continue
        sys.stderr.write(f"  {part} …\n")
        try:
            result[part] = do()
        except (SideganError, ValueError) as error:  # Pinocchio finds fewer meshes than sidegan
            result["refused"] = str(error)
            write_bytes(file, json.dumps(result, indent=1).encode())
            return
        result.pop("refused", None)
        write_bytes(file, json.dumps(result, indent=1).encode())


def robot_file(name: str, folder: Path | None = None) -> Path:
    """The description of an arm, in example-robot-data or, where it is of another wheel, in a folder.

    Raises:
        SideganError: when it is not there.
    """
    if "wheel" in ARMS[name]:
        if folder is None or not (folder / ARMS[name]["file"]).is_file():
            raise SideganError(
                f"{name} is in {ARMS[name]['wheel']}: unpack it, and name the folder: --descriptions"
            )
        return folder / ARMS[name]["file"]
    folders = (Path(entry, _ROBOTS) for entry in sys.path)
    found = next((folder for folder in folders if folder.is_dir()), None)
    if found is None:
        raise SideganError("this needs example-robot-data: pip install 'sidegan[arms]'")
    return found / ARMS[name]["file"]


def task_of(file: Path, words: Sequence[str], work: Path, more: Sequence[str] = ()) -> Task:
    """The excitation of an arm with some settings."""
    given = ["+experiment=excite", f"robot.name={file}", f"outputs={work}", "tracking=off", *words, *more]
    return Task(composed(*given), Store(work))


def _load(file: Path, given: Sequence[str]) -> dict[str, Any]:
    """What it took to load an arm with its pairs and its home beside some settings, and what is said."""

    def load(words: list[str]) -> Task:
        task = task_of(file, words, Path("outputs"))
        _ = task.constraints
        return task

    task, words = remedied(load, given)
    return {
        "words": words,
        "joints": task.arm.joints,
        "told": list(task.arm.told),
        "checked": task.constraints.described(),
        "floor": task.cfg.workspace.told(task.arm),
    }


def facts_of(task: Task) -> Facts:
    """What an independent check has to know beside the description."""
    arm, constraints = task.arm, task.constraints
    exempt = [list(one.links) for one in constraints.exempt if one.why != "never touch"]
    floors = [region for region in constraints.regions if isinstance(region, Plane)]
    limits = task.cfg.robot.limits
    stated = {
        kind: dict(values)
        for kind in ("position", "velocity", "effort", "acceleration", "jerk")
        if (values := getattr(limits, kind))
    }
    for kind, values in (("acceleration", arm.acceleration_limit), ("jerk", arm.jerk_limit)):
        if values is not None:
            finite = [(n, x) for n, x in zip(arm.joint_names, values.tolist()) if np.isfinite(x)]
            stated[kind] = {**dict(finite), **stated.get(kind, {})}
    never_out = constraints.excepted.get("keep_out", ())
    return Facts(
        locked=locked_joints(task),
        exempt=exempt,
        floor=floors[0].offset if floors else None,
        standing=[name.rpartition(" in region ")[0] for name in never_out],
        limits=stated,
    )


def locked_joints(task: Task) -> dict[str, float]:
    """Where the joints stand that do not move [rad or m]."""
    from sidegan.robot.chain import choose
    from sidegan.robot.sources import read_source
    from sidegan.robot.tree import read_tree

    root = read_source(task.arm.urdf, task.arm.setup.args).root
    for extra in [element for element in root if element.tag not in ("link", "joint")]:
        root.remove(extra)
    return choose(read_tree(root, str(task.arm.urdf), task.arm.setup.base), task.arm.setup).locked


def _compare(file: Path, words: Sequence[str]) -> dict[str, Any]:
    """How often self-collision is refused though the meshes are free, and missed though they collide."""
    task = task_of(file, words, Path("outputs"), ["workspace.clearance=0"])
    arm, constraints = task.arm, task.constraints
    random = torch.Generator().manual_seed(0)
    draw = torch.rand(_CONFIGURATIONS, arm.joints, generator=random, dtype=torch.float64)
    q = torch.lerp(arm.position_lower, arm.position_upper, draw)
    margins = constraints.at_rest(q)
    refused = (margins["collision"] < 0).any(1).numpy() if "collision" in margins else np.zeros(len(q), bool)
    robot = Robot(file, arm.joint_names, facts_of(task))
    collided = robot.colliding(robot.configurations(q.numpy()))
    return {
        "configurations": len(q),
        "free": float((~collided).mean()),
        "refused": float(refused[~collided].mean()) if not collided.all() else 0.0,
        "missed": float((~refused[collided]).mean()) if collided.any() else 0.0,
    }


def _excite(file: Path, words: Sequence[str], work: Path, more: Sequence[str]) -> dict[str, Any]:
    """Seconds from the file to a set, by the clock and of all processors, and what the set is worth."""
    run = work / "run"
    command = [sys.executable, "-m", "sidegan.run", "+experiment=excite", f"robot.name={file}"]
    command += [*words, f"outputs={work}", "tracking=off", f"hydra.run.dir={run}", *more]
    began, used = time.monotonic(), _used()
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    seconds, cpu = time.monotonic() - began, _used() - used
    if done.returncode:
        said = done.stderr.strip().splitlines()[-_LINES:]
        raise SideganError(" ".join(said))
    caption = (run / "set.md").read_text("utf-8").splitlines()[0]
    condition = float(caption.split("condition of the set ")[1].split(",")[0])
    shown = " ".join(map(quote, command[1:]))
    return {"seconds": seconds, "cpu": cpu, "condition": condition, "command": shown}


def _used() -> float:
    """Time that processors have spent on processes which this one started and which have ended [s]."""
    spent = resource.getrusage(resource.RUSAGE_CHILDREN)
    return spent.ru_utime + spent.ru_stime


def _rate(file: Path, words: Sequence[str], work: Path, more: Sequence[str]) -> dict[str, float]:
    """Trajectories that are checked in a second of one core's time: random ones, and those of the set."""
    task = task_of(file, words, work, more)
    random = task.problem.start(_TIMED, torch.Generator().manual_seed(0))
    chosen = Library.load(work / "run" / LIBRARY, task.arm).coefficients
    pools = {"random": random, "set": chosen.repeat(max(1, _TIMED // len(chosen)), 1, 1, 1)}
    threads, found = torch.get_num_threads(), {}
    torch.set_num_threads(1)
    for name, c in pools.items():
        (run,) = medians(_REPEATS, partial(task.check, c))
        found[name] = len(c) / run.cpu
    torch.set_num_threads(threads)
    return found


def _check(file: Path, words: Sequence[str], work: Path, more: Sequence[str]) -> dict[str, Any]:
    """The independent check of the whole set at 1 kHz."""
    task, folder = task_of(file, words, work, more), work / "kilohertz"
    chosen = Library.load(work / "run" / LIBRARY, task.arm)
    names = [f"{kind}_{name}" for kind in ("q", "dq", "ddq") for name in task.arm.joint_names]
    times = task.trajectory.times(_RATE)
    for k in range(len(chosen)):
        motion = task.trajectory.roll_out(chosen.coefficients[k : k + 1], times)
        rows = torch.cat([times[:, None], *(x[0] for x in motion[1:])], 1).numpy()
        table = pd.DataFrame(rows, columns=["time", *names])
        write_bytes(folder / f"{k + 1:03}.csv", table.to_csv(index=False, float_format="%.12g").encode())
    found = check_folder(file, folder, facts_of(task))
    for path in folder.glob("*.csv"):
        path.unlink()
    return found


def _is_well(result: dict[str, Any]) -> bool:
    check = result.get("independent", {})
    return bool(check) and check["valid"] == check["trajectories"]


def page(work: Path) -> str:
    """The page of what is done so far."""
    results = [json.loads(path.read_text("utf-8")) for path in sorted(work.glob("*.json"))]
    results.sort(key=lambda one: list(ARMS).index(one["name"]))
    table = pd.DataFrame([row_of(one) for one in results])
    refused = {one["name"]: one["refused"] for one in results if "refused" in one}
    how = {one["name"]: one["loaded"] for one in results if "loaded" in one}
    last = {name: ARMS[name]["wheel"] for name in how if "wheel" in ARMS[name]}
    return template(Path(__file__).with_name("arms.md.j2")).render(
        table=markdown(table) if len(table) else "", refused=refused, how=how, last=last, machine=machine()
    )


def row_of(result: dict[str, Any]) -> dict[str, str]:
    """An arm's row of the table."""
    parts = ("loaded", "shapes", "set", "independent", "rate")
    loaded, shapes, made, check, rate = (result.get(part) for part in parts)
    open_ = "—"
    return {
        "arm": result["name"],
        "joints": str(loaded["joints"]) if loaded else open_,
        "loaded": _how(loaded["words"]) if loaded else open_,
        "falsely refused": f"{shapes['refused']:.2%}" if shapes else open_,
        "missed": f"{shapes['missed']:.2%}" if shapes else open_,
        "CPU s": f"{made['cpu']:.0f}" if made else open_,
        "cond of the set": f"{made['condition']:.3g}" if made else open_,
        "checks/s": f"{rate['random']:,.0f}, {rate['set']:,.0f}" if rate else open_,
        "valid at 1 kHz": f"{check['valid']} of {check['trajectories']}" if check else open_,
        "velocity": f"{check['velocity']:.0%}" if check else open_,
        "torque": f"{check['effort']:.0%}" if check else open_,
        "acceleration": _share(check, "acceleration"),
        "jerk": _share(check, "jerk"),
    }


def _how(words: Sequence[str]) -> str:
    """How an arm was loaded, in few words."""
    names = dict.fromkeys(
        word.partition("=")[0].removeprefix("robot.").removeprefix("limits.") for word in words
    )
    return f"with {', '.join(names)}" if names else "as it is"


def _share(check: dict[str, Any] | None, kind: str) -> str:
    """Largest share of a limit that not all descriptions state."""
    return f"{check[kind]:.0%}" if check and check[kind] else "—"


if __name__ == "__main__":
    sys.exit(main())
