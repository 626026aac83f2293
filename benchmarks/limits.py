"""The command ``python -m benchmarks.limits [panda=FILE] [ur10e=FILE]``: what acceleration limits cost.

Trajectories that are optimised under limits of acceleration and jerk stand beside those that are optimised
without, and then slowed down until they fit: at s times the period velocities are 1/s, accelerations 1/s² and
jerks 1/s³ of what they were.
"""

import argparse
import sys
from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import pandas as pd
import torch
import yaml
from torch import Tensor

from sidegan.design.problem import Problem
from sidegan.errors import RobotError
from sidegan.motion.trajectory import Trajectory
from sidegan.report import export
from sidegan.robot import HIGHER, Arm, Limits, Setup, load_robot
from sidegan.seeds import Gradient
from sidegan.validity import Constraints, check, default_home

ARMS: dict[str, dict[str, Any]] = yaml.safe_load(Path(__file__).with_name("limits.yaml").read_text("utf-8"))
_RATE = 1000.0  # [Hz] at which it is looked how much of a limit is used
_FINER = 3  # the condition number is taken at so many times the optimiser's samples, as seeds report it
_HAIR = 1 + 1e-6  # by which what is slowed down stays within a limit


@dataclass(frozen=True)
class Slowed:
    """Trajectories made slow enough for an arm's limits: one period each."""

    stretch: Tensor  # of their periods, at least 1, (N,)
    fitness: Tensor  # their condition numbers then, (N,)
    valid: Tensor  # whether every constraint holds then, (N,)


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 1 when an arm is not there, or slowing down does better."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.limits", description=__doc__)
    parser.add_argument("files", nargs="*", metavar="NAME=FILE", help=f"descriptions of {', '.join(ARMS)}")
    parser.add_argument("--count", type=int, default=35, help="trajectories of each kind (default 35)")
    parser.add_argument("--steps", type=int, default=200, help="of the optimiser (default 200)")
    options = parser.parse_args(arguments)
    files = dict(entry.split("=", 1) for entry in options.files if "=" in entry)
    if len(files) < len(options.files) or not set(files) <= {about["name"] for about in ARMS.values()}:
        parser.error(f"descriptions are given as NAME=FILE, with NAME one of {', '.join(ARMS)}")
    torch.set_num_threads(1)
    rows, lost = [], False
    for name, about in ARMS.items():
        sys.stderr.write(f"{name} …\n")
        try:
            one = limited(files.get(about["name"], about["name"]), about)
        except RobotError as error:
            rows.append({"arm": name, "stated": str(error)})
            lost = True
            continue
        rows.append({"arm": name, **compare(one, options.count, options.steps)})
        lost |= rows[-1]["ours"] > rows[-1]["slowed down"]
    export.show(table(rows), f"Condition number at the median of {options.count}, 16 s and 6 harmonics")
    return int(lost)


def limited(description: str, about: dict[str, Any]) -> Arm:
    """The arm of a description with these limits of its joints."""
    names = load_robot(description).joint_names
    limits = {kind: dict(zip(names, about[kind], strict=True)) for kind in HIGHER if kind in about}
    return load_robot(description, Setup(limits=Limits(**limits)))


def compare(arm: Arm, count: int, steps: int) -> dict[str, Any]:
    """A row: the optimum under the limits beside the one without, as it is and slowed down."""
    own = Constraints(arm)
    trajectory = Trajectory(arm.joints, home=default_home(own))
    problem = Problem(own, trajectory)
    free = replace(problem, constraints=Constraints(replace(arm, acceleration_limit=None, jerk_limit=None)))
    method = Gradient(steps, attempts=5, reserve=0.02)
    ours, theirs = (method.optimise(one, count, np.random.SeedSequence(0)) for one in (problem, free))
    slower = slow_down(problem, theirs.coefficients)
    return {
        "ours": float(ours.fitness.median()),
        "slowed down": float(slower.fitness.median()),
        "unlimited": float(theirs.fitness.median()),
        "exceed": float((slower.stretch > 1).double().mean()),
        "slower by": float(slower.stretch.median()),
        "valid then": float(slower.valid.double().mean()),
        "CPU s": ours.cpu_seconds / max(1, len(ours)),
        "CPU s unlimited": theirs.cpu_seconds / max(1, len(theirs)),
    }


def slow_down(problem: Problem, c: Tensor) -> Slowed:
    """Trajectories (N, J, H, 2) of the problem's family, each at the shortest period that fits."""
    family = problem.trajectory
    stretch = torch.ones(len(c), dtype=torch.float64)
    for name, limit in problem.constraints.higher.items():
        x = family.derivative(c, family.times(_RATE), HIGHER[name])
        use = (x.abs() / limit).amax((1, 2)) * _HAIR
        stretch = torch.maximum(stretch, use ** (1 / HIGHER[name]))
    fitness, valid = [], []
    for one, s in zip(c, stretch.tolist()):
        slow = replace(family, period=family.period * s)
        found = replace(problem, trajectory=slow, samples=_FINER * problem.samples).fitness(one[None] / s)
        fitness.append(found)
        valid.append(check(problem.constraints, slow, one[None] / s).valid)
    return Slowed(stretch, torch.cat(fitness), torch.cat(valid))


def table(rows: Sequence[dict[str, Any]]) -> pd.DataFrame:
    """The rows as they are shown."""
    shares = {"exceed", "valid then"}
    cells = [
        {
            key: value if isinstance(value, str) else f"{value:.0%}" if key in shares else f"{value:.3g}"
            for key, value in row.items()
        }
        for row in rows
    ]
    return pd.DataFrame(cells).fillna("").set_index("arm")


if __name__ == "__main__":
    sys.exit(main())
