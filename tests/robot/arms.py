"""Arms that people own: what their refusals ask for, what a judge has to know, and what it finds.

A row of docs/arms.md of a URDF or xacro file, in a checkout: ``python -m tests.robot.arms FILE SETTING…``.
"""

import re
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np
import pandas as pd

from sidegan.errors import SideganError
from sidegan.pipeline.compose import composed
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.store import Store
from sidegan.report.export import markdown
from sidegan.robot import command_messages
from sidegan.robot.chain import choose_chain
from sidegan.robot.sources import read_source
from sidegan.robot.tree import read_tree
from sidegan.validity import Plane
from tests.robot.judge import Facts, Judge

CONFIGURATIONS = 2_000  # random ones, that shapes are compared in
SET = "goal.count=3", "search.evaluations=130", "controllers.formats=[csv]", "controllers.rate=1000"
_ROUNDS = 6  # of following what refusals say
_SETTING = r"(?:robot|workspace)(?:\.[a-z_]+)*="
_REMEDY = re.compile(rf"'({_SETTING}[^']*)'|({_SETTING}[^\s;,]+)")
_FOLDER = "cmeel.prefix/share/example-robot-data/robots"
# Folder of example-robot-data's descriptions, the extra ``arms``, where they are installed.
ROBOTS = next((folder for entry in sys.path if (folder := Path(entry, _FOLDER)).is_dir()), None)


def task_of(file, words, work):
    """The excitation of an arm with some settings."""
    given = ["+experiment=excite", f"robot.name={file}", f"outputs={work}", "tracking=off", *words]
    return RunContext(composed(*given), Store(Path(work), Path(work)))


def facts_of(context):
    """What an independent check has to know beside the description."""
    arm, constraints = context.cell.arm, context.cell.constraints
    tree = read_tree(read_source(arm.urdf, arm.setup.args).root, str(arm.urdf))
    floors = [region.offset for region in constraints.regions if isinstance(region, Plane)]
    limits = {kind: dict(x) for kind, x in vars(arm.setup.limits).items() if x and kind != "file"}
    for kind, values in arm.higher_limits.items():
        limits[kind] = dict(zip(arm.joint_names, values.tolist()))
    return Facts(
        locked=choose_chain(tree, arm.setup)[1],
        exempt=constraints.link_pairs.exempt,
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
            with command_messages():
                return work(said), said
        except SideganError as error:
            offered = [(a or b).split("=", 1) for a, b in _REMEDY.findall(str(error))]
            tips = [word for word in offered if word[0] == "robot.tip" and "robot.tip" not in words]
            more = words | dict(tips[:1] or [word for word in offered if word[0] != "robot.tip"])
            if more == words:
                raise
            words = more
    raise AssertionError(f"refused {_ROUNDS} times, at last with {words}")


def shape_accuracy(constraints, judge, configurations):
    """Shares of free random configurations that are refused, and of colliding ones that are missed."""
    arm, random = constraints.arm, np.random.default_rng(0)
    draw = random.random((configurations, arm.joints))
    q = arm.position_lower + draw * (arm.position_upper - arm.position_lower)
    collided = judge.colliding(judge.configurations(q))
    refused = (constraints.at_rest(q).get("collision", np.ones((len(q), 1))) < 0).any(1)
    return tuple(int(x.sum()) / max(1, len(x)) for x in (refused[~collided], ~refused[collided]))


@dataclass(frozen=True)
class Outcome:
    """What became of an arm."""

    joints: int
    said: list[str]  # settings that its refusals asked for
    refused: float  # shares of free random configurations, and of colliding ones; nan without shapes
    missed: float
    verdicts: pd.DataFrame  # the judge's, a row a trajectory

    @property
    def row(self):
        """Its row of the table."""
        values = {"falsely refused": self.refused, "missed": self.missed}
        shares = {name: "no shapes" if np.isnan(x) else f"{x:.2%}" for name, x in values.items()}
        use = f"{self.verdicts.velocity.min():.0%} to {self.verdicts.velocity.max():.0%}"
        valid = f"{self.verdicts.valid.sum()} of {len(self.verdicts)}"
        said = " ".join(f"`'{word}'`" if "[" in word or "{" in word else f"`{word}`" for word in self.said)
        said = {"joints": self.joints, "settings needed": said or "nothing"}
        return {**said, **shares, "valid at 1 kHz": valid, "use of the limits": use}


def outcome(file, given, work):
    """Loads an arm as its refusals say, compares its shapes with its meshes, and judges a set of it."""

    def load(words):
        context = task_of(file, [*words, *SET], work)
        assert context.cell.constraints.labels
        return context

    context, words = remedied(load, given)
    facts, bare = facts_of(context), task_of(file, [*words, "workspace.clearance=0"], work)
    floorless = judge_of(context.cell.arm, replace(facts, floor=-np.inf))
    refused = missed = np.nan
    if floorless.geometry.collisionPairs:
        refused, missed = shape_accuracy(bare.cell.constraints, floorless, CONFIGURATIONS)
    run_stages(context.cfg, work / "run", context.cell.arm.name)
    judge = judge_of(context.cell.arm, facts)
    files = sorted((work / "run" / "trajectories").glob("[0-9]*.csv"))
    verdicts = pd.DataFrame([judged(judge, path) for path in files])
    return Outcome(context.cell.arm.joints, words[len(given) :], refused, missed, verdicts)


def judge_of(arm, facts):
    """The judge of an arm, of the URDF that a xacro file becomes."""
    xacro = read_source(arm.urdf, arm.setup.args).text.decode() if arm.urdf.suffix == ".xacro" else None
    return Judge(arm.urdf, arm.joint_names, facts, xacro)


def judged(judge, path):
    """The judge's verdict on a file of a trajectory."""
    table = pd.read_csv(path)
    kinds = ("q", "dq", "ddq")
    return judge(table.time.to_numpy(), *(table[[f"{k}_{n}" for n in judge.names]].to_numpy() for k in kinds))


if __name__ == "__main__":
    with TemporaryDirectory() as folder:
        found = outcome(sys.argv[1], sys.argv[2:], Path(folder))
    print(markdown(pd.DataFrame([{"arm": Path(sys.argv[1]).name.partition(".")[0], **found.row}])))
