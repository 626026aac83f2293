"""Stage timing: how fast the generators are on this machine, one thread."""

import logging
import os
import platform
import time
from collections.abc import Callable
from functools import partial
from pathlib import Path

import torch

from sidegan.base.storage import read_json, write_json
from sidegan.gan import TrajectoryGenerator
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import GENERATOR, REPORT, Task
from sidegan.pipeline.stages.common import words
from sidegan.pipeline.tracking import Tracker
from sidegan.validity import check

log = logging.getLogger(__name__)

_BATCH = 1000
_SECONDS = 3.0  # [s] of every measurement


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Time the first training of every variant."""
    task = Task(cfg, store)
    for name in cfg.gan:
        folder = store.produce(task.timing(name, cfg.trainings[0]), partial(_make, task, name))
        report = read_json(folder / REPORT)
        log.info("speed of %s: %s", name, words(report))
        numbers = {key: value for key, value in report.items() if isinstance(value, float)}
        tracker.log_metrics({f"timing/{name}/{key}": value for key, value in numbers.items()})


def _make(task: Task, name: str, folder: Path, work: Path) -> None:
    path = task.store.require(task.gan(name, task.cfg.gan[name], task.cfg.trainings[0])) / GENERATOR
    generator = TrajectoryGenerator.load(path, task.arm)
    noise = torch.Generator().manual_seed(task.number(f"timing {name}"))
    physics = (task.constraints, task.trajectory)
    before = torch.get_num_threads()
    torch.set_num_threads(1)
    try:
        generated = _rate(lambda: len(generator.sample(_BATCH, noise)))
        valid = _rate(lambda: int(check(*physics, generator.sample(_BATCH, noise)).valid.sum()))
    finally:
        torch.set_num_threads(before)
    machine = {"machine": _processor(), "cores": os.cpu_count() or 1, "torch": torch.__version__}
    write_json(folder / REPORT, {"generation_seconds": 1 / generated, "valid_per_second": valid, **machine})


def _rate(work: Callable[[], int]) -> float:
    """Things per second that ``work`` makes, over a few seconds of repetitions, the first one left out."""
    work()
    began, made = time.perf_counter(), 0
    while time.perf_counter() - began < _SECONDS:
        made += work()
    return made / (time.perf_counter() - began)


def _processor() -> str:
    """Name of the processor, as far as the system tells."""
    try:
        lines = Path("/proc/cpuinfo").read_text(encoding="utf-8").splitlines()
    except OSError:
        return platform.processor() or platform.machine()
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else platform.machine()
