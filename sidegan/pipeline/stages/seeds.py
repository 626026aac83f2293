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


def seed_set(task: Task, title: str = "seeds") -> Artifact:
    """The seed set, or the configured half of it; each method is a maker of its own."""
    settings = method_settings(task)
    maker = "seeds" if settings.method == "gradient" else f"{settings.method}_seeds"
    label = settings.method if settings.fitness == "eigenvalue" else f"{settings.method}-{settings.fitness}"
    if settings.method != "paper" and settings.steps != task.cfg.scale.seed_steps:
        label += f"-{settings.steps}steps"  # sets of other quality stand side by side
        title += f" {settings.steps} steps"
    whole = task.artifact(maker, label, _make, settings.stamped(), title=title, alone=True)
    if task.cfg.half is None:
        return whole
    name, values = f"{label}-half{task.cfg.half}", {"half": task.cfg.half}
    return task.artifact("halves", name, _halve, values, {"seeds": whole}, title=title)


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


def _halve(task: Task, build: Build) -> None:
    whole = task.load(seed_set(task.with_settings(half=None)))
    middle = len(whole) // 2
    half = whole.take(range(middle, len(whole)) if task.cfg.half else range(middle))
    half.save(build.folder / LIBRARY)
    write_json(build.folder / REPORT, summary(half))


def _sets(task: Task) -> list[Artifact]:
    seeds = seed_set(task)
    return [*seeds.parents, seeds]


STAGE = Stage(
    _sets, columnwise=True, check=lambda task: task.require_room(task.cfg.seeds.count, "seeds.count")
)
