"""Stage transfer: a generator for another arm, tool or desk, from scratch and from one that is there."""

from dataclasses import asdict, dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import torch
from torch import Tensor

from sidegan.base.storage import write_json
from sidegan.gan import TrajectoryGenerator, Variant
from sidegan.gan.metrics import measure
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.schema import Target
from sidegan.pipeline.stage import Stage, finite
from sidegan.pipeline.stages.polish import source
from sidegan.pipeline.stages.training import keep_history
from sidegan.pipeline.task import GENERATOR, REPORT, Task
from sidegan.robot import Arm, load_robot, write_urdf
from sidegan.validity import Constraints, Plane

SCRATCH, BRIEF, TRANSFER = "scratch", "brief", "transfer"  # brief: from scratch, but as short as a transfer
WAYS = (SCRATCH, BRIEF, TRANSFER)
_ARMS = Path(__file__).parent / "arms"
_BALL = 0.05  # [m] radius of gyration of a payload


def transfer(task: Task, name: str, way: str) -> Artifact:
    """A training for a target, by one of the ways."""
    settings, target = task.cfg.beyond, task.cfg.beyond.targets[name]
    inputs: dict[str, Artifact | str] = {"gan": source(task)} if way == TRANSFER else {}
    if target.robot is not None:
        inputs["target"] = _arm_of(task, target).digest
    values = {key: getattr(settings, key) for key in ("epochs", "epoch", "share", "polished")}
    values |= {"target": asdict(target), "way": way, "variant": asdict(task.cfg.gan[settings.source])}
    make = partial(_make, target=target, name=name, way=way)
    return task.artifact("transfer", f"{name}-{way}", make, values, inputs, title=f"transfer/{name} {way}")


def transfers(task: Task) -> dict[tuple[str, str], Artifact]:
    """Every training for a target."""
    return {(name, way): transfer(task, name, way) for name in task.cfg.beyond.targets for way in WAYS}


def _arm_of(task: Task, target: Target) -> Arm:
    """The arm of a target without its payload: the task's own, or one beside this file, or any other."""
    if target.robot is None:
        return task.arm
    ours = _ARMS / f"{target.robot}.urdf"
    return load_robot(ours if ours.is_file() else target.robot)


@dataclass(frozen=True)
class Elsewhere:
    """What a target stands for.

    Attributes:
        task: where the generator comes from.
        target: what differs.
        folder: where the description of an arm with a payload is written.
    """

    task: Task
    target: Target
    folder: Path

    @cached_property
    def arm(self) -> Arm:
        """The arm, with its payload."""
        arm = _arm_of(self.task, self.target)
        if not self.target.payload:
            return arm
        loaded = arm.inertial_parameters.clone()
        loaded[-1] += _ball(self.target.payload, arm.tip)
        write_urdf(arm, loaded, self.folder / "arm.urdf")
        return load_robot(self.folder / "arm.urdf", replace(arm.setup, args=None, home=None))

    @cached_property
    def constraints(self) -> Constraints:
        """The arm in its workspace."""
        workspace, desk = self.task.cfg.workspace, self.target.desk
        regions = workspace.shapes(self.task.arm) if desk is None else [Plane((0.0, 0.0, 1.0), desk)]
        home = self.trajectory.home or ()
        constraints = workspace.around(self.arm, home, regions)
        constraints.refuse_home(home)
        return constraints

    @cached_property
    def trajectory(self) -> Trajectory:
        """Trajectories around the target's home."""
        return replace(self.task.trajectory, home=self.target.home or self.task.trajectory.home)


def _ball(mass: float, centre: Tensor) -> Tensor:
    """Inertial parameters, (10,), of a ball of a mass [kg] around a point [m], (3,)."""
    inertia = mass * (centre.square().sum() * torch.eye(3).to(centre) - torch.outer(centre, centre))
    inertia = inertia + mass * _BALL**2 * torch.eye(3).to(centre)
    rows, columns = (0, 0, 1, 0, 1, 2), (0, 1, 1, 2, 2, 2)
    return torch.cat([centre.new_tensor([mass]), mass * centre, inertia[rows, columns]])


def schedule(task: Task, way: str) -> Variant:
    """The source variant with the schedule of one way."""
    settings = task.cfg.beyond
    epochs = settings.epochs if way == SCRATCH else max(1, round(settings.share * settings.epochs))
    return replace(task.cfg.gan[settings.source], epochs=epochs, steps=settings.epoch)


def _make(task: Task, build: Build, target: Target, name: str, way: str) -> None:
    from sidegan.gan.training import Run, train_variant

    there, variant = Elsewhere(task, target, build.folder), schedule(task, way)
    count, facts, start = max(2, 2 * task.cfg.beyond.polished), {}, None
    if way == TRANSFER:
        start = TrajectoryGenerator.load(task.store.require(source(task)) / GENERATOR, task.arm)
        moved = start.transferred(there.arm, there.trajectory)
        facts = measure(there.constraints, there.trajectory, moved.sample(count))
    run = Run(
        task.cfg.beyond.source,
        task.number(f"transfer {name} {way}"),
        build.work,
        count,
        task.cfg.device,
        lambda epoch, _: build.report(epoch + 1, variant.epochs),
        start,
    )
    trained = train_variant(variant, there.constraints, there.trajectory, None, run)
    trained.generator.save(build.folder / GENERATOR)
    keep_history(build, trained.history)
    write_json(build.folder / REPORT, finite({"kept_epoch": trained.epoch + 1, **facts}))


STAGE = Stage(lambda task: list(transfers(task).values()))
