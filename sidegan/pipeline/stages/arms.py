"""Stage arms: seeds, generators and what they are worth, of every arm of a comparison."""

from collections.abc import Iterator
from dataclasses import replace

from sidegan.pipeline.artifact import Artifact
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages import stage

_STAGES = ("seeds", "surrogates", "gan", "library", "random", "measures")


def of_arms(run: RunContext) -> dict[str, RunContext]:
    """The run for each arm, by its name among the settings."""
    return {name: run.with_other("robot", name) for name in run.cfg.arms}


def _arms(run: RunContext) -> Iterator[Artifact]:
    for name, one in of_arms(run).items():
        for part in map(stage, _STAGES):
            for artifact in part.artifacts(one):
                yield replace(artifact, title=f"{name} {artifact.title}")


def _check(run: RunContext) -> None:
    for one in of_arms(run).values():
        _ = one.cell.constraints
        for part in map(stage, _STAGES):
            part.check(one)


STAGES = {"arms": Stage(_arms, check=_check)}
