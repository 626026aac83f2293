"""Stage optimised: seeds that use as much of the limits as exact variants do, the fair opponent of both."""

from dataclasses import replace

from sidegan.base.storage import write_json
from sidegan.library.measure import measured, summary
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import LIBRARY, REPORT, Task
from sidegan.seeds import Tasks, make_seeds
from sidegan.seeds.settings import Seeds

OPTIMISED = "optimised"


def optimised(task: Task) -> Artifact:
    """As many optimised trajectories as there are seeds, with little reserve."""
    return task.artifact("optimised", "gradient", _make, _settings(task).stamped(), alone=True)


def _settings(task: Task) -> Seeds:
    return replace(
        task.cfg.seeds,
        method="gradient",
        fitness="eigenvalue",
        steps=task.cfg.scale.seed_steps,
        reserve=task.cfg.beyond.reserve,
        ants=None,
        evaluations=None,
    )


def _make(task: Task, build: Build) -> None:
    settings = _settings(task)
    problem = settings.problem(task.constraints, task.trajectory)
    tasks = Tasks(settings.count, settings.batch, build.work, task.cfg.parallel.workers)
    batch = make_seeds(problem, settings.optimiser, tasks, task.random("optimised"))
    library = measured(task.constraints, task.trajectory, batch.coefficients, OPTIMISED)
    library.save(build.folder / LIBRARY)
    build.costs |= {"cpu_seconds": batch.cpu_seconds, "each": batch.cpu_seconds / len(library)}
    attempts = {"attempts": batch.attempts, "failed": batch.failed}
    share = {"valid_share": 1 - batch.failed / batch.attempts}
    write_json(build.folder / REPORT, {**summary(library), **attempts, **share})


STAGE = Stage(lambda task: [optimised(task)])
