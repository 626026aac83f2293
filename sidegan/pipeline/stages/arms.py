"""Stage arms: seeds, generators and what they are worth, of every arm of a comparison."""

from collections.abc import Iterator
from dataclasses import replace

from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages import stage
from sidegan.pipeline.task import Task

_STAGES = ("seeds", "surrogates", "gan", "library", "random", "measures")


def of_arms(task: Task) -> dict[str, Task]:
    """The task for each arm, by its name among the settings."""
    return {name: task.with_other("robot", name) for name in task.cfg.arms}


def _arms(task: Task) -> Iterator[Artifact]:
    for name, one in of_arms(task).items():
        for part in map(stage, _STAGES):
            for artifact in part.artifacts(one):
                yield replace(artifact, title=f"{name} {artifact.title}")


def _check(task: Task) -> None:
    for one in of_arms(task).values():
        _ = one.constraints
        for part in map(stage, _STAGES):
            part.check(one)


STAGES = {"arms": Stage(_arms, check=_check)}
