"""Stage surrogates: train success predictor and converters on exactly labelled samples."""

import logging
from collections.abc import Iterable
from functools import partial
from pathlib import Path

from sidegan.base.parallel import Job, run_jobs
from sidegan.base.storage import read_json, write_json
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import GENERATOR, NEGATIVES_TRAINING, REPORT, Task, variant
from sidegan.pipeline.stages.common import finite, numbers, training_seeds, words
from sidegan.pipeline.stages.train import train_variants
from sidegan.pipeline.tracking import Tracker

log = logging.getLogger(__name__)

LABEL_SHARES = 8


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train success predictor and converters, where a variant learns from them."""
    data = {settings.data for name, settings in cfg.gan.items() if variant(name, settings).surrogates}
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
    from sidegan.gan import TrajectoryGenerator, jobs

    wanted, workers, number = task.cfg.surrogates, task.cfg.parallel.workers, task.number
    ((name, settings),) = wanted.negatives.items()
    source = task.store.require(task.gan(name, settings, NEGATIVES_TRAINING)) / GENERATOR
    vanilla = TrajectoryGenerator.load(source, task.arm)
    negatives = vanilla.sample(jobs.negatives_wanted(wanted.samples), task.number("negatives"))
    physics, seed_set = (task.constraints, task.trajectory), training_seeds(task).coefficients
    known = (jobs.training_seeds(seed_set)[0], jobs.training_negatives(negatives)[0])
    count, steps = -(-wanted.samples // LABEL_SHARES), wanted.margin_steps
    shares = [work / f"labels-{i}.pt" for i in range(LABEL_SHARES)]
    labelling = [
        partial(jobs.label_share, *physics, *known, count, steps, data, path, task.number(f"labels {i}"))
        for i, path in enumerate(shares)
    ]
    run_jobs("labels", labelling, workers, wanted.samples)
    sizes = jobs.Sizes(wanted.width, wanted.margin_steps, wanted.feature_steps)
    epochs = wanted.epochs
    trainings: list[Job] = [
        partial(
            jobs.train_success,
            *physics,
            seed_set,
            negatives,
            shares,
            sizes,
            epochs,
            folder,
            number("success"),
        ),
        *(
            partial(
                jobs.train_features, task.arm, physics[1], name, shares, sizes, epochs, folder, number(name)
            )
            for name in ("spectrum", "diagonal")
        ),
    ]
    parts = run_jobs("surrogates", trainings, workers, wanted.epochs * len(trainings))
    write_json(folder / REPORT, {key: value for part in parts for key, value in finite(part).items()})
