"""Stage generator: a generator of what designs start from, trained once for an arm in its workspace."""

from dataclasses import asdict

from sidegan.base.storage import write_json
from sidegan.designer import Generator, make_generator
from sidegan.designer.scene import ArmNumbers
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import REPORT, Task

FILE = "generator.pt"


def generator(task: Task) -> Artifact:
    """The generator of the configured designer's starts."""
    grid = {name: getattr(task.cfg.designer, name) for name in ("samples", "refine")}
    return task.artifact("generator", "generator", _make, {**asdict(task.cfg.generator), **grid})


def load(task: Task) -> Generator:
    """A generator that must be there."""
    numbers = ArmNumbers(task.constraints, task.trajectory)
    return Generator.load(task.store.require(generator(task)) / FILE, numbers)


def _make(task: Task, build: Build) -> None:
    cfg, random = task.cfg, task.random("generator")
    made = make_generator(
        task.constraints, task.trajectory, cfg.designer, cfg.generator, random, build.report
    )
    made.save(build.folder / FILE, ArmNumbers(task.constraints, task.trajectory))
    write_json(build.folder / REPORT, {"modes": len(made), "spread": float(made.modes.std())})


STAGE = Stage(lambda task: [generator(task)])
