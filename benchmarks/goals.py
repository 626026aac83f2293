"""The command ``python -m benchmarks.goals``: sets that are designed for a goal, beside ordinary ones.

Each row is a set of the LWR on its desk, each column what is to be expected of it: standard deviations of a
tool, of parameters, of torques, by the model with friction and rotors.
"""

import argparse
import sys
import time
from collections.abc import Sequence
from dataclasses import replace
from typing import Any, TypeVar

import numpy as np
import pandas as pd
import torch
from omegaconf import OmegaConf
from torch import Tensor

from sidegan.base.typed import build
from sidegan.design.information import information_of
from sidegan.design.optimal import d_optimal
from sidegan.design.problem import Problem
from sidegan.design.sequence import Search, told
from sidegan.designer import DesignerSettings
from sidegan.identification import FULL, GoalSettings
from sidegan.identification.designed import designed
from sidegan.identification.uncertain import Uncertain, unmeasured
from sidegan.motion.trajectory import Trajectory
from sidegan.report import export
from sidegan.robot import load_robot
from sidegan.seeds import Gradient
from sidegan.validity import Constraints, Plane

_EXCITE, _DESIGNER = "conf/experiment/excite.yaml", "conf/designer/default.yaml"
_POOL, _STEPS, _ATTEMPTS, _RESERVE = 4, 120, 5, 0.05  # of the ordinary set, as ``excite`` makes it
_POINTS = 200  # of a trajectory, at which its information is taken
_LAST = ("link_6", "link_7")

T = TypeVar("T")


def main(arguments: Sequence[str] | None = None) -> int:
    """Exit code of the command: 1 when a set tells what it was designed for worse than the ordinary one."""
    parser = argparse.ArgumentParser(prog="python -m benchmarks.goals", description=__doc__)
    parser.add_argument("--count", type=int, default=1, help="trajectories of each set (default 1)")
    parser.add_argument("--period", type=float, default=8.0, help="of a trajectory [s] (default 8)")
    options = parser.parse_args(arguments)
    torch.set_num_threads(1)
    arm = load_robot("kuka_lwr4")
    desk = Constraints(arm, [Plane(normal=(0, 0, 1), offset=0.10)])
    problem = Problem(desk, Trajectory(arm.joints, 6, options.period))
    table = compared(problem, options.count)
    export.show(table, f"{options.count} × {options.period:g} s of {arm.name}: deviations to be expected")
    ordinary = table.iloc[0]
    return int(any(table.loc[name, name] >= ordinary[name] for name in GOALS))


GOALS: dict[str, str | list[str]] = {
    "payload": "payload",
    "links 6 and 7": [*_LAST],
    "all": "all",
    "prediction": "prediction",
}


def compared(problem: Problem, count: int) -> pd.DataFrame:
    """A row per set: deviations by each goal over those of the ordinary set, and those of a tool."""
    settings = OmegaConf.load(_EXCITE)
    goals, search = built(GoalSettings, settings.goal), built(Search, settings.search)
    designer = built(DesignerSettings, OmegaConf.load(_DESIGNER))
    rows: dict[str, dict[str, float]] = {}
    taken: dict[str, float] = {}

    def aim(wanted: str | list[str]) -> Uncertain:
        return unmeasured(problem.body, FULL, replace(goals, wanted=wanted))

    def made(name: str, wanted: str | list[str] | None) -> Tensor:
        sys.stderr.write(f"{name} …\n")
        began = time.process_time()
        if wanted is None:
            c = ordinary(problem, count)
        else:
            c = designed(problem, aim(wanted), count, designer, goals.evaluations, search, seed=0)
        taken[name] = time.process_time() - began
        return c

    sets = {name: made(name, wanted) for name, wanted in {"ordinary": None, **GOALS}.items()}
    for name, c in sets.items():
        rows[name] = {goal: left(problem, aim(wanted), c) for goal, wanted in GOALS.items()}
        tool = aim("payload")
        left(problem, tool, c)
        mass, first, second = (float(x.square().mean().sqrt()) for x in tool.deviations.split([1, 3, 6]))
        rows[name] |= {"design [CPU s]": taken[name]}
        rows[name] |= {"mass [g]": 1e3 * mass, "m·c [g·m]": 1e3 * first, "inertia [g·m²]": 1e3 * second}
    table = pd.DataFrame.from_dict(rows, orient="index").rename_axis("designed for")
    table[[*GOALS]] /= table.loc["ordinary", [*GOALS]]
    return table.map(lambda x: float(f"{x:.3g}"))


def built(schema: type[T], settings: Any) -> T:
    """Settings of a part of the configuration."""
    return build(schema, OmegaConf.to_container(settings))  # type: ignore[arg-type]


def left(problem: Problem, aim: Uncertain, c: Tensor) -> float:
    """What a set leaves of an aim's deviations; the aim knows it then."""
    for one in c:
        aim.take(told(problem, aim, one[None], _POINTS))
    return aim.left


def ordinary(problem: Problem, count: int) -> Tensor:
    """A D-optimal pick of trajectories of small condition number."""
    best = Gradient(_STEPS, _ATTEMPTS, _RESERVE)
    pool = best.optimise(problem, _POOL * count, np.random.SeedSequence(0)).coefficients
    information = information_of(problem.body, problem.trajectory, pool)
    return pool[d_optimal(information, min(count, len(pool)))]


if __name__ == "__main__":
    sys.exit(main())
