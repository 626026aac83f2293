"""Stage seeds: the seed set, by the configured optimiser."""

from sidegan.base.storage import write_json
from sidegan.library.measure import measured, summary
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import LIBRARY, REPORT, Task
from sidegan.seeds import Tasks, make_seeds


def seed_set(task: Task, title: str = "seeds") -> Artifact:
    """The seed set; each method is a maker of its own, whose numbers change alone."""
    settings = task.cfg.seeds
    maker = "seeds" if settings.method == "gradient" else f"{settings.method}_seeds"
    label = settings.method if settings.fitness == "eigenvalue" else f"{settings.method}-{settings.fitness}"
    return task.artifact(maker, label, _make, settings, title=title, alone=True)


def _make(task: Task, build: Build) -> None:
    settings = task.cfg.seeds
    problem = settings.problem(task.constraints, task.trajectory)
    tasks = Tasks(settings.count, settings.batch, build.work, task.cfg.parallel.workers)
    batch = make_seeds(problem, settings.optimiser, tasks, task.random("seeds"))
    library = measured(task.constraints, task.trajectory, batch.coefficients, settings.method)
    library.save(build.folder / LIBRARY)
    build.costs["cpu_seconds"] = batch.cpu_seconds
    attempts = {"attempts": batch.attempts, "failed": batch.failed, "faults": batch.faults}
    write_json(build.folder / REPORT, {**summary(library), **attempts})


STAGE = Stage(lambda task: [seed_set(task)])
