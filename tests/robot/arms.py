"""Arms that people own: their descriptions, what their refusals ask for, and what a judge has to know."""

import re
import sys
from pathlib import Path

import numpy as np
import torch

from sidegan.errors import SideganError
from sidegan.pipeline.compose import composed
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from sidegan.robot.chain import choose
from sidegan.robot.sources import read_source
from sidegan.robot.tree import read_tree
from sidegan.validity import Plane
from tests.robot.judge import Facts

_ROUNDS = 6  # of following what refusals say
_SETTING = r"(?:robot|workspace)(?:\.[a-z_]+)*="
_REMEDY = re.compile(rf"'({_SETTING}[^']*)'|({_SETTING}[^\s;,]+)")
_FOLDER = "cmeel.prefix/share/example-robot-data/robots"
# Folder of example-robot-data's descriptions, the extra ``arms``, where they are installed.
ROBOTS = next((folder for entry in sys.path if (folder := Path(entry, _FOLDER)).is_dir()), None)


def task_of(file, words, work):
    """The excitation of an arm with some settings."""
    given = ["+experiment=excite", f"robot.name={file}", f"outputs={work}", "tracking=off", *words]
    return Task(composed(*given), Store(Path(work), Path(work)))


def facts_of(task):
    """What an independent check has to know beside the description."""
    arm, constraints = task.arm, task.constraints
    root = read_source(arm.urdf, arm.setup.args).root
    for extra in [element for element in root if element.tag not in ("link", "joint")]:
        root.remove(extra)
    floors = [region.offset for region in constraints.regions if isinstance(region, Plane)]
    limits = {kind: dict(x) for kind, x in vars(task.cfg.robot.limits).items() if x}
    for kind, values in arm.higher_limits.items():
        limits[kind] = dict(zip(arm.joint_names, values.tolist()))
    return Facts(
        locked=choose(read_tree(root, str(arm.urdf)), arm.setup)[1],
        exempt=constraints.of_links.exempt,
        floor=floors[0] if floors else -np.inf,
        standing=[name.rpartition(" in region ")[0] for name in constraints.never_out],
        limits=limits,
    )


def remedied(work, given=()):
    """Outcome of ``work(words)``, and the words that it took; of several ends of an arm the first."""
    words = dict(word.split("=", 1) for word in given)
    for _ in range(_ROUNDS):
        said = [f"{name}={value}" for name, value in words.items()]
        try:
            return work(said), said
        except SideganError as error:
            offered = [(a or b).split("=", 1) for a, b in _REMEDY.findall(str(error))]
            tips = [one for one in offered if one[0] == "robot.tip" and "robot.tip" not in words]
            more = words | dict(tips[:1] or [one for one in offered if one[0] != "robot.tip"])
            if more == words:
                raise
            words = more
    raise AssertionError(f"refused {_ROUNDS} times, at last with {words}")


def shape_accuracy(constraints, judge, configurations):
    """Shares of free random configurations that are refused, and of colliding ones that are missed."""
    arm, random = constraints.arm, torch.Generator().manual_seed(0)
    draw = torch.rand(configurations, arm.joints, generator=random, dtype=torch.float64)
    q = torch.lerp(arm.position_lower, arm.position_upper, draw)
    collided = torch.from_numpy(judge.colliding(judge.configurations(q.numpy())))
    refused = (constraints.at_rest(q).get("collision", q.new_ones(len(q), 1)) < 0).any(1)
    return tuple(int(x.sum()) / max(1, len(x)) for x in (refused[~collided], ~refused[collided]))
