"""Stage arms: seeds, generators and their measures for several arms."""

from collections.abc import Iterator
from dataclasses import replace

from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages import stage

_STAGES = ("seeds", "surrogates", "gan", "library", "random", "measures")


def of_arms(run: RunContext) -> dict[str, RunContext]:
    """The run for each configured arm, by the arm's name in the settings."""
    return {name: run.with_other("robot", name) for name in run.cfg.arms}


def _arms(run: RunContext) -> Iterator[Artifact]:
    for name, arm_run in of_arms(run).items():
        for part in map(stage, _STAGES):
            for artifact in part.artifacts(arm_run):
                yield replace(artifact, title=f"{name} {artifact.title}")


def _check(run: RunContext) -> None:
    for arm_run in of_arms(run).values():
        _ = arm_run.cell.constraints
        for part in map(stage, _STAGES):
            part.check(arm_run)


STAGES = {"arms": Stage(_arms, check=_check)}
