"""Stage kinds: other kinds of seed sets, to compare the seeds with."""

from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.task import Task


def kind(task: Task, name: str) -> Artifact:
    """The seed set of another kind, all of it."""
    return seed_set(task.with_settings(seeds=task.cfg.kinds[name], half=None), f"seeds {name}")


STAGE = Stage(lambda task: [kind(task, name) for name in task.cfg.kinds], columnwise=True)
