"""Stage transfer: a generator for another arm, tool or desk, from scratch and from one that is there."""

import logging
from dataclasses import dataclass, replace
from functools import cached_property, partial
from pathlib import Path

import torch
from torch import Tensor

from sidegan.base.parallel import Report
from sidegan.base.storage import read_json, write_json
from sidegan.gan import TrajectoryGenerator, Variant
from sidegan.gan.metrics import measure
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline import plan_beyond
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.config_beyond import Target
from sidegan.pipeline.plan import GENERATOR, HISTORY, REPORT, Task, regions
from sidegan.pipeline.stages.common import finite, produce_all, words
from sidegan.pipeline.tracking import Tracker
from sidegan.robot import Arm, load_robot, write_urdf
from sidegan.validity import Constraints, Plane

log = logging.getLogger(__name__)

_BALL = 0.05  # [m] radius of gyration of a payload


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train for every target in every way."""
    task = Task(cfg, store)
    wanted = [(target, way) for target in cfg.beyond.targets for way in plan_beyond.WAYS]
    stamps = [plan_beyond.transfer(task, *one) for one in wanted]
    produce_all(task, "transfer (%)", stamps, [partial(_make, task, *one) for one in wanted])
    for (target, way), stamp in zip(wanted, stamps):
        history = read_json(store.require(stamp) / HISTORY)
        log.info("%s, %s: %s", target, way, words(history[-1]))


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
        arm = plan_beyond.arm_of(self.task, self.target)
        if not self.target.payload:
            return arm
        loaded = arm.inertial_parameters.clone()
        loaded[-1] += _ball(self.target.payload, arm.tip)
        write_urdf(arm, loaded, self.folder / "arm.urdf")
        return load_robot(self.folder / "arm.urdf")

    @cached_property
    def constraints(self) -> Constraints:
        """The arm in its workspace."""
        workspace = self.task.cfg.workspace
        desk = self.target.desk
        around = regions(workspace) if desk is None else [Plane((0.0, 0.0, 1.0), desk)]
        constraints = Constraints(self.arm, around, workspace.torque)
        constraints.refuse_home(self.trajectory.home or ())
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
    wanted = task.cfg.beyond
    settings = task.cfg.gan[plan_beyond.source(task)]
    epochs = wanted.epochs if way == plan_beyond.SCRATCH else max(1, round(wanted.share * wanted.epochs))
    return replace(settings, epochs=epochs, steps=wanted.epoch)


def _make(task: Task, target: str, way: str, folder: Path, work: Path, report: Report) -> None:
    from sidegan.gan.training import Run, train_variant

    there = Elsewhere(task, task.cfg.beyond.targets[target], folder)
    wanted, count, facts = schedule(task, way), max(2, 2 * task.cfg.beyond.polished), {}
    start = None
    if way == plan_beyond.TRANSFER:
        start = _source(task)
        facts = measure(
            there.constraints, there.trajectory, start.transferred(there.arm, there.trajectory).sample(count)
        )
    once = Run(
        plan_beyond.source(task),
        task.number(f"transfer {target} {way}"),
        work,
        evaluation=count,
        device=task.cfg.device,
        epoch_end=lambda epoch, _: report(epoch + 1, wanted.epochs),
        start=start,
    )
    trained = train_variant(wanted, there.constraints, there.trajectory, None, once)
    trained.generator.save(folder / GENERATOR)
    write_json(folder / HISTORY, [finite(row) for row in trained.history])
    write_json(folder / REPORT, finite(facts))


def _source(task: Task) -> TrajectoryGenerator:
    path = task.store.require(plan_beyond.source_stamp(task)) / GENERATOR
    return TrajectoryGenerator.load(path, task.arm)
