"""Arms that people own: where their descriptions are, and what an independent check has to know."""

import sys
from pathlib import Path

import numpy as np

from sidegan.pipeline.compose import composed
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from sidegan.robot.chain import choose
from sidegan.robot.sources import read_source
from sidegan.robot.tree import read_tree
from sidegan.validity import Plane
from tests.robot.judge import Facts

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
    for kind, values in (("acceleration", arm.acceleration_limit), ("jerk", arm.jerk_limit)):
        if values is not None:
            finite = {n: x for n, x in zip(arm.joint_names, values.tolist()) if np.isfinite(x)}
            limits[kind] = finite | limits.get(kind, {})
    return Facts(
        locked=choose(read_tree(root, str(arm.urdf), arm.setup.base), arm.setup).locked,
        exempt=[list(one.links) for one in constraints.exempt if one.why != "never touch"],
        floor=floors[0] if floors else -np.inf,
        standing=[name.rpartition(" in region ")[0] for name in constraints.excepted.get("keep_out", ())],
        limits=limits,
    )
