"""Stage seeds: the seed set, by the configured optimiser."""

from dataclasses import replace

from sidegan.base.parallel import cores
from sidegan.base.storage import write_json
from sidegan.designer import Compiled
from sidegan.library.measure import measured, summary
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.task import LIBRARY, REPORT, Task
from sidegan.seeds import Method, Seeds, Tasks, make_seeds


def method_settings(task: Task) -> Seeds:
    """The settings of the seed set, by gradients of a batch where there are no kernels."""
    settings = task.cfg.seeds
    if settings.method == "compiled" and not Compiled.serves():
        return replace(settings, method="gradient")
    return settings


def seed_set(task: Task) -> Artifact:
    """The seed set; each method is a maker of its own."""
    settings = method_settings(task)
    maker = "seeds" if settings.method == "gradient" else f"{settings.method}_seeds"
    label = settings.method if settings.fitness == "eigenvalue" else f"{settings.method}-{settings.fitness}"
    return task.artifact(maker, label, _make, settings.stamped(), title="seeds", alone=True)


def _make(task: Task, build: Build) -> None:
    settings, workers = method_settings(task), task.cfg.parallel.workers
    problem = settings.problem(task.constraints, task.trajectory)
    method, size = _method(settings, workers)
    tasks = Tasks(settings.count, size, build.work, workers, settings.enough)
    batch = make_seeds(problem, method, tasks, task.random("seeds"))
    library = measured(task.constraints, task.trajectory, batch.coefficients, settings.method)
    library.save(build.folder / LIBRARY)
    build.costs["cpu_seconds"] = batch.cpu_seconds
    attempts = {"attempts": batch.attempts, "failed": batch.failed, "faults": batch.faults}
    write_json(build.folder / REPORT, {**summary(library), **attempts})


def _method(settings: Seeds, workers: int | None) -> tuple[Method, int]:
    """The optimiser, and how many seeds are one task: all of them where it shares its work among threads."""
    if settings.method != "compiled":
        return settings.optimiser, settings.batch
    threads = cores(workers)
    return Compiled(settings.steps, settings.attempts, settings.reserve or 0.0, threads), settings.count


STAGE = Stage(
    lambda task: [seed_set(task)], check=lambda task: task.require_room(task.cfg.seeds.count, "seeds.count")
)
