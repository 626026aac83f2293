"""What the artifacts of the page on exact physics are made from, beside ``plan``."""

from dataclasses import asdict, replace
from pathlib import Path
from typing import Any

from sidegan.errors import ConfigError
from sidegan.pipeline.config_beyond import Target
from sidegan.pipeline.plan import IDENTIFICATION, RANDOM, SEEDS, Task
from sidegan.pipeline.stamp import Stamp
from sidegan.robot import Arm, load_robot

POLISHED = "polished"  # the source's trajectories after gradient steps
OPTIMISED = "optimised"  # like the seeds, but with little reserve

GREEDY, OPTIMAL = "greedy", "D-optimal"  # ways to pick a set
SCRATCH, BRIEF, TRANSFER = "scratch", "brief", "transfer"  # brief: from scratch, but as short as a transfer
WAYS = (SCRATCH, BRIEF, TRANSFER)
_ARMS = Path(__file__).parent / "stages" / "arms"


def pools(task: Task) -> list[tuple[str, int]]:
    """Name and training of every pool that is compared."""
    return [(OPTIMISED, 0), *task.short_sets(), *((POLISHED, training) for training in task.cfg.trainings)]


def titled(task: Task, name: str, training: int) -> str:
    """Name of a pool for people; the training is told where there are several."""
    several = name == POLISHED and len(task.cfg.trainings) > 1
    return f"{name}-{training}" if several else task.named(name, training)


def source(task: Task) -> str:
    """The variant that is polished and transferred.

    Raises:
        ConfigError: when it is not trained.
    """
    name = task.cfg.beyond.source
    if name not in task.cfg.gan:
        raise ConfigError(f"beyond.source is {name!r}, expected one of gan: {', '.join(task.cfg.gan)}")
    return name


def source_stamp(task: Task, training: int | None = None) -> Stamp:
    """Of the generator that is polished and transferred; its first training when None."""
    name = source(task)
    return task.gan(name, task.cfg.gan[name], task.cfg.trainings[0] if training is None else training)


def pool(task: Task, name: str, training: int) -> Stamp:
    """Of the random trajectories, the seeds, a generator's own library, or the polished one."""
    if name == POLISHED:
        return polished(task, training)
    if name == OPTIMISED:
        return optimised(task)
    if name in task.cfg.gan:
        return task.library(name, training)
    return task.random_set if name == RANDOM else task.seeds


def first_set(task: Task, name: str, training: int) -> Stamp:
    """Of the measured time to a first set of valid trajectories."""
    values: dict[str, Any] = {"count": task.cfg.selection.count}
    inputs: dict[str, str] = {}
    if name in task.cfg.gan:
        inputs["gan"] = task.gan(name, task.cfg.gan[name], training).digest
    elif name == SEEDS:
        values |= {key: x for key, x in asdict(task.cfg.seeds).items() if key != "count"}
    code = ["gan", "seeds", "stages.random", "stages.first_set"]
    return task.stamp("first_set", name, values, inputs, code, _trained(name, training))


def best(task: Task, name: str, training: int) -> Stamp:
    """Of what the best sets of one pool are worth."""
    inputs = {"pool": pool(task, name, training).digest}
    values = {**asdict(task.cfg.identification), "repeats": task.cfg.beyond.repeats}
    values |= {"count": task.cfg.selection.count, "evaluation": task.cfg.scale.evaluation}
    code = [*IDENTIFICATION, "criteria", "information", "optimal", "selection", "stages.best"]
    return task.stamp("best", name, values, inputs, code, _trained(name, training))


def polish(task: Task) -> Stamp:
    """Of the curve of quality against gradient steps."""
    wanted = task.cfg.beyond
    values = {"steps": wanted.steps, "count": wanted.polished}
    inputs = {"gan": source_stamp(task).digest}
    return task.stamp("polish", source(task), values, inputs, ["seeds", "stages.polish"])


def optimised(task: Task) -> Stamp:
    """Of optimised trajectories that use as much of the limits as the exact variants do."""
    wanted = task.cfg.seeds
    values = {"steps": task.cfg.scale.seed_steps, "reserve": task.cfg.beyond.reserve}
    values |= {key: getattr(wanted, key) for key in ("count", "samples", "batch")}
    return task.stamp("optimised", "gradient", values, {}, ["seeds", "stages.optimised"])


def polished(task: Task, training: int) -> Stamp:
    """Of a library of polished trajectories."""
    values = {"steps": task.cfg.beyond.finish, "count": task.cfg.seeds.count, "batch": task.cfg.library.batch}
    inputs = {"gan": source_stamp(task, training).digest}
    return task.stamp(
        "polished", source(task), values, inputs, ["library", "seeds", "stages.polish"], training
    )


def arm_of(task: Task, target: Target) -> Arm:
    """The arm of a target without its payload: the task's own, or one of ``stages/arms``, or any other."""
    if target.robot is None:
        return task.arm
    ours = _ARMS / f"{target.robot}.urdf"
    return load_robot(ours if ours.is_file() else target.robot)


def transfer(task: Task, target: str, way: str) -> Stamp:
    """Of a training for a target, by one of ``WAYS``."""
    wanted = task.cfg.beyond
    inputs = {}
    if wanted.targets[target].robot is not None:
        inputs["target"] = arm_of(task, wanted.targets[target]).digest
    if way == TRANSFER:
        inputs["gan"] = source_stamp(task).digest
    values = {key: getattr(wanted, key) for key in ("epochs", "epoch", "share", "polished")}
    values |= {"target": asdict(wanted.targets[target]), "way": way}
    values |= {"variant": asdict(task.cfg.gan[source(task)])}
    return task.stamp("transfer", f"{target}-{way}", values, inputs, ["gan", "seeds", "stages.transfer"])


def with_objectives(task: Task) -> Task:
    """The same task with one training of each objective in place of the variants."""
    cfg = replace(task.cfg, gan=task.cfg.objectives, trainings=task.cfg.trainings[:1], stages=[])
    return Task(cfg, task.store)


def few_sizes(task: Task) -> list[int]:
    """Numbers of seeds, ascending; the last is all of them."""
    whole = task.cfg.seeds.count
    return [*sorted(size for size in task.cfg.beyond.sizes if size < whole), whole]


def with_few(task: Task, size: int) -> Task:
    """The same task with one training of the variants for few seeds, on so many of them."""
    cfg = task.cfg
    subset = size if size < cfg.seeds.count else None
    few = replace(cfg, gan=cfg.few_seeds, trainings=cfg.trainings[:1], subset=subset, stages=[])
    return Task(few, task.store)


def _trained(name: str, training: int) -> int | None:
    return None if name in (RANDOM, SEEDS, OPTIMISED) else training
