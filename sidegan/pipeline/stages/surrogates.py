"""Stage surrogates: train success predictor and converters on exactly labelled samples."""

import logging
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from sidegan.base.parallel import Job, run_jobs
from sidegan.base.storage import read_json, write_json
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import GENERATOR, NEGATIVES_TRAINING, REPORT, Task
from sidegan.pipeline.stages.common import finite, numbers, training_seeds, words
from sidegan.pipeline.stages.train import train_variants
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train success predictor and converters, where a variant learns from them."""
    data = {settings.data for settings in cfg.gan.values() if settings.surrogates}
    if data:
        make(Task(cfg, store), sorted({"broad", *data}), tracker)
    else:
        log.info("no surrogates: none of %s learns from them", ", ".join(cfg.gan))


def make(task: Task, data: Iterable[str], tracker: Tracker) -> None:
    """Train the surrogates of every kind of data, unless they are there."""
    train_variants(task, task.cfg.surrogates.negatives, [NEGATIVES_TRAINING])
    for kind in data:
        report = read_json(task.store.produce(task.surrogates(kind), partial(_make, task, kind)) / REPORT)
        series = {key: value for key, value in report.items() if isinstance(value, list)}
        log.info("surrogates, %s data: %s", kind, words(numbers(report)))
        tracker.log_metrics({f"surrogates {kind}/{key}": value for key, value in numbers(report).items()})
        tracker.log_history({f"surrogates {kind}/{key}": value for key, value in series.items()})


def _make(task: Task, data: str, folder: Path, work: Path) -> None:
    from sidegan.gan import TrajectoryGenerator
    from sidegan.gan.jobs import SHARES, Pretraining, negatives_count

    settings, workers = task.cfg.surrogates, task.cfg.parallel.workers
    ((name, source),) = settings.negatives.items()
    stored = task.store.require(task.gan(name, source, NEGATIVES_TRAINING)) / GENERATOR
    vanilla = TrajectoryGenerator.load(stored, task.arm)
    negatives = vanilla.sample(negatives_count(settings.samples), task.number("negatives"))
    seeds = training_seeds(task).coefficients
    training = Pretraining(task.constraints, task.trajectory, settings, data, seeds, negatives, work)
    labelling = [partial(training.label, i, task.number(f"labels {i}")) for i in range(SHARES)]
    run_jobs("labels", labelling, workers, settings.samples)
    trainings: list[Job] = [
        partial(training.train_success, folder, task.number("success")),
        *(
            partial(training.train_features, kind, folder, task.number(kind))
            for kind in ("spectrum", "diagonal")
        ),
    ]
    parts = run_jobs("surrogates", trainings, workers, settings.epochs * len(trainings))
    write_json(folder / REPORT, {key: value for part in parts for key, value in finite(part).items()})
