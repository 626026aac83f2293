"""One short function per stage: load artifacts, call the rooms below, save artifacts.

Each takes (configuration, store, tracker) and may be run alone: what it needs must be there already.
"""

import logging
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict
from functools import partial
from pathlib import Path
from typing import Any

import pandas as pd
import torch
from torch import Tensor

from sidegan import config
from sidegan.artifacts import Store
from sidegan.config import Config, GanVariant
from sidegan.errors import InfeasibleError
from sidegan.excitation import excite
from sidegan.identification import Noise, study
from sidegan.library import Library
from sidegan.parallel import Job, Report, run_jobs
from sidegan.plan import Task, variant
from sidegan.report.tables import arrow
from sidegan.selection import greedy
from sidegan.stamp import Stamp
from sidegan.storage import read_json, write_json, write_parquet
from sidegan.tracking import Tracker
from sidegan.trajectory import Trajectory
from sidegan.validity import Constraints, check

log = logging.getLogger(__name__)

LIBRARY, GENERATOR, HISTORY, REPORT = "library.parquet", "generator.pt", "history.json", "report.json"
RESULTS, SETS = "results.parquet", "sets.parquet"
RATE = 12.5  # [Hz] at which stored excitation is taken: finer than any optimiser's samples
LABEL_SHARES = 8
TEST_REACH = 0.8  # of the tightest joint limit, that a test trajectory uses
_BATCH = 250


def seeds(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Make the seed set by the configured optimiser."""
    task = Task(cfg, store)
    task.constraints.refuse_home(task.trajectory.home or ())
    folder = store.produce(task.seeds, partial(_seed_set, task))
    library, report = Library.load(folder / LIBRARY, task.arm), read_json(folder / REPORT)
    facts = summary(library) | numbers(report)
    log.info("seeds: %s", words(facts))
    tracker.log_metrics({f"seeds/{key}": value for key, value in facts.items()})


def surrogates(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train success predictor and converters on exactly labelled samples."""
    task = Task(cfg, store)
    _train_variants(task, cfg.surrogates.negatives)
    report = read_json(store.produce(task.surrogates, partial(_surrogates, task)) / REPORT)
    series = {key: value for key, value in report.items() if isinstance(value, list)}
    log.info("surrogates: %s", words(numbers(report)))
    tracker.log_metrics({f"surrogates/{key}": value for key, value in numbers(report).items()})
    tracker.log_history({f"surrogates/{key}": value for key, value in series.items()})


def gan(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train the configured variants."""
    task = Task(cfg, store)
    _train_variants(task, cfg.gan)
    for name, settings in cfg.gan.items():
        history = read_json(store.require(task.gan(name, settings)) / HISTORY)
        epochs = {key: [row[key] for row in history] for key in history[0]}
        known = {key: [(i, v) for i, v in enumerate(x) if v is not None] for key, x in epochs.items()}
        for key, pairs in known.items():
            tracker.log_history({f"{name}/{key}": [v for _, v in pairs]}, [i for i, _ in pairs])
        log.info("%s after %d epochs: %s", name, len(history), words(history[-1]))


def library(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Draw from each generator and keep what is valid."""
    task = Task(cfg, store)
    stamps = [task.library(name) for name in cfg.gan]
    _produce_all(task, "libraries (%)", stamps, [partial(_expand, task, name) for name in cfg.gan])
    for name, stamp in zip(cfg.gan, stamps):
        report = read_json(store.require(stamp) / REPORT)
        log.info("library of %s: %s", name, words(report))
        tracker.log_metrics({f"library/{name}/{key}": value for key, value in numbers(report).items()})


def long(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Optimise the single long trajectory in each of its readings."""
    task = Task(cfg, store)
    stamps = [task.long(h) for h in cfg.long.harmonics]
    _produce_all(task, "long trajectories (%)", stamps, [partial(_long, task, h) for h in cfg.long.harmonics])
    for h, stamp in zip(cfg.long.harmonics, stamps):
        report = read_json(store.require(stamp) / REPORT)
        log.info("long trajectory, %d harmonics: %s", h, words(report))
        tracker.log_metrics({f"long/{h}/{key}": value for key, value in numbers(report).items()})


def selection(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Pick the excitation sets greedily: from the seeds, and from the seeds and each library."""
    task = Task(cfg, store)
    seed_set = _seeds(task)
    for name in ["seeds", *cfg.gan]:
        pool = seed_set
        if name != "seeds":
            pool = seed_set.merge(Library.load(store.require(task.library(name)) / LIBRARY, task.arm))

        def make(folder: Path, work: Path, pool: Library = pool) -> None:
            pool.take(greedy(pool.diagonal, cfg.selection.count)).save(folder / LIBRARY)

        chosen = Library.load(store.produce(task.selection(name), make) / LIBRARY, task.arm)
        new = sum(source != cfg.seeds.method for source in chosen.source)
        log.info("selection from %s: %d of %d, %d of them generated", name, len(chosen), len(pool), new)
        tracker.log_metrics({f"selection/{name}/generated": new})


def identification(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Identify the arm from each excitation set and predict test torques with the result."""
    task = Task(cfg, store)
    folder = store.produce(task.identification, partial(_compare, task))
    frame = pd.read_parquet(folder / RESULTS)
    mean = frame.groupby(["set", "weighted"], as_index=False).nmse.mean()
    tracker.log_metrics(
        {
            f"nmse/{name}/{'weighted' if weighted else 'unweighted'}": value
            for name, weighted, value in mean.itertuples(index=False)
        }
    )


def table(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Print, write and record the experiment's table and figures."""
    import importlib

    task = Task(cfg, store)
    experiment = importlib.import_module(f"experiments.{cfg.experiment}")
    folder = store.require(task.identification)
    material = experiment.Material(
        results=pd.read_parquet(folder / RESULTS),
        sets=pd.read_parquet(folder / SETS),
        histories={
            name: read_json(store.require(task.gan(name, s)) / HISTORY) for name, s in cfg.gan.items()
        },
        generators=_generators(task),
        config=cfg,
    )
    experiment.present(material, store.run_folder, tracker)


STAGES = {
    "seeds": seeds,
    "surrogates": surrogates,
    "gan": gan,
    "library": library,
    "long": long,
    "selection": selection,
    "identification": identification,
    "table": table,
}


def measured(constraints: Constraints, trajectory: Trajectory, c: Tensor, source: str) -> Library:
    """A library of coefficients (N, J, H, 2) with everything measured about them."""
    parts = []
    for batch in c.split(_BATCH):
        validity = check(constraints, trajectory, batch)
        excitation = excite(constraints.body, trajectory, batch, round(RATE * trajectory.period))
        parts.append(
            Library(
                coefficients=batch,
                valid=validity.valid,
                margins=validity.margins,
                fitness=excitation.eigenvalue_fitness,
                diagonal_fitness=excitation.diagonal_fitness,
                spectrum=excitation.spectrum,
                diagonal=excitation.diagonal,
                source=[source] * len(batch),
                robot=constraints.arm.name,
                digest=constraints.arm.digest,
                period=trajectory.period,
                home=tuple(trajectory.home or ()),
            )
        )
    merged = parts[0]
    for part in parts[1:]:
        merged = merged.merge(part)
    return merged


def summary(library: Library) -> dict[str, float]:
    """Validity, fitness and diversity of a library."""
    from sidegan.excitation import Excitation
    from sidegan.gan.metrics import diversity

    return {
        "count": len(library),
        "valid": float(library.valid.double().mean()),
        "condition": float(library.fitness.median()),
        "diagonal_ratio": float(library.diagonal_fitness.median()),
        **diversity(library.coefficients, Excitation(library.spectrum, library.diagonal)),
    }


def numbers(report: Mapping[str, object]) -> dict[str, float]:
    """The numeric entries of a report."""
    return {key: float(value) for key, value in report.items() if isinstance(value, (int, float))}


def words(report: dict[str, Any]) -> str:
    """A report as one line for people."""
    return ", ".join(
        f"{key} {value:.4g}" if isinstance(value, float) else f"{key} {value}"
        for key, value in report.items()
    )


def study_settings(settings: config.Identification) -> study.Settings:
    """The comparison's settings as plain values."""
    noise = Noise(**asdict(settings.noise))
    common = (settings.rate, settings.prior, settings.forgetting, settings.weighted)
    return study.Settings(*common, noise, settings.repeats)


def _seed_set(task: Task, folder: Path, work: Path) -> None:
    from sidegan.seeds import SeedProblem, Tasks, make_seeds, method_of

    wanted, diagonal = task.cfg.seeds, task.cfg.seeds.fitness == "diagonal"
    extra = {"ants": wanted.ants, "evaluations": wanted.evaluations}
    options = {key: value for key, value in extra.items() if value is not None}
    method = method_of(wanted.method, wanted.steps, wanted.attempts, **options)
    problem = SeedProblem(task.constraints, task.trajectory, wanted.samples, diagonal)
    tasks = Tasks(wanted.count, wanted.batch, work, task.cfg.parallel.workers)
    batch = make_seeds(problem, method, tasks, task.random("seeds"))
    library = measured(task.constraints, task.trajectory, batch.coefficients, wanted.method)
    library.save(folder / LIBRARY)
    report = {"attempts": batch.attempts, "failed": batch.failed, "cpu_seconds": batch.cpu_seconds}
    write_json(folder / REPORT, {"count": len(batch), **report, "faults": batch.faults})


def _seeds(task: Task) -> Library:
    return Library.load(task.store.require(task.seeds) / LIBRARY, task.arm)


def _produce_all(
    task: Task, what: str, stamps: Sequence[Stamp], makes: Sequence[Callable[..., None]]
) -> None:
    """Produce artifacts side by side, each in a process of its own; ``make(folder, work, report)``."""
    missing = [(stamp, make) for stamp, make in zip(stamps, makes) if task.store.find(stamp) is None]
    if missing:
        run_jobs(what, [partial(_produce, task.store, *one) for one in missing], task.cfg.parallel.workers)


def _produce(store: Store, stamp: Stamp, make: Callable[..., None], report: Report) -> None:
    store.produce(stamp, partial(make, report=report))


def _train_variants(task: Task, variants: dict[str, GanVariant]) -> None:
    stamps = [task.gan(name, settings) for name, settings in variants.items()]
    makes = [partial(_train, task, name, settings) for name, settings in variants.items()]
    new = [name for name, stamp in zip(variants, stamps) if task.store.find(stamp) is None]
    _produce_all(task, f"training {', '.join(new)} (%)", stamps, makes)


def _train(task: Task, name: str, settings: GanVariant, folder: Path, work: Path, report: Report) -> None:
    from sidegan.gan import jobs
    from sidegan.gan.training import train_variant

    wanted = variant(name, settings)
    predictor = converter = None
    if wanted.surrogates:
        source = task.store.require(task.surrogates)
        predictor = jobs.load_predictor(source, task.arm, task.trajectory)
        if wanted.features != "none":
            converter = jobs.load_converter(source, wanted.features, task.arm, task.trajectory)
    trained = train_variant(
        wanted,
        task.constraints,
        task.trajectory,
        _seeds(task).coefficients,
        work,
        seed=task.number(f"gan {name}"),
        evaluation=task.cfg.scale.evaluation,
        predictor=predictor,
        converter=converter,
        device=task.cfg.device,
        epoch_end=lambda epoch, _: report(epoch + 1, wanted.epochs),
    )
    trained.generator.save(folder / GENERATOR)
    write_json(folder / HISTORY, [finite(row) for row in trained.history])


def _surrogates(task: Task, folder: Path, work: Path) -> None:
    from sidegan.gan import TrajectoryGenerator, jobs

    wanted, workers = task.cfg.surrogates, task.cfg.parallel.workers
    ((name, settings),) = wanted.negatives.items()
    vanilla = TrajectoryGenerator.load(task.store.require(task.gan(name, settings)) / GENERATOR, task.arm)
    negatives = vanilla.sample(jobs.negatives_wanted(wanted.samples), task.number("negatives"))
    physics, seed_set = (task.constraints, task.trajectory), _seeds(task).coefficients
    known = (jobs.training_seeds(seed_set)[0], jobs.training_negatives(negatives)[0])
    size = (-(-wanted.samples // LABEL_SHARES), wanted.margin_steps)
    shares = [work / f"labels-{i}.pt" for i in range(LABEL_SHARES)]
    labelling = [
        partial(jobs.label_share, *physics, *known, *size, path, task.number(f"labels {i}"))
        for i, path in enumerate(shares)
    ]
    run_jobs("labels", labelling, workers, wanted.samples)
    sizes = jobs.Sizes(wanted.width, wanted.margin_steps, wanted.feature_steps)
    epochs, number = wanted.epochs, task.number
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


def _expand(task: Task, name: str, folder: Path, work: Path, report: Report) -> None:
    """Sample, check and keep until the library is full."""
    from sidegan.gan import TrajectoryGenerator

    wanted = task.cfg.library
    path = task.store.require(task.gan(name, task.cfg.gan[name])) / GENERATOR
    generator = TrajectoryGenerator.load(path, task.arm)
    noise = torch.Generator().manual_seed(task.number(f"library {name}"))
    kept: list[Tensor] = []
    drawn = count = 0
    while count < wanted.count and drawn < wanted.draws:
        c = generator.sample(wanted.batch, noise)
        kept.append(c[check(task.constraints, task.trajectory, c).valid])
        drawn, count = drawn + len(c), count + len(kept[-1])
        report(max(min(count, wanted.count), drawn * wanted.count // wanted.draws), wanted.count)
    if count < wanted.count:
        log.warning(
            "%s gave %d valid trajectories in %d draws, %d were wanted", name, count, drawn, wanted.count
        )
    if not count:
        raise InfeasibleError(f"none of {drawn} trajectories drawn from {name} is valid")
    made = measured(task.constraints, task.trajectory, torch.cat(kept)[: wanted.count], name)
    made.save(folder / LIBRARY)
    share = {"drawn": drawn, "valid_share": count / drawn}
    write_json(folder / REPORT, share | {k: v for k, v in summary(made).items() if k != "valid"})


def _long(task: Task, harmonics: int, folder: Path, work: Path, report: Report) -> None:
    from sidegan.seeds import SeedProblem, make_long

    settings, trajectory = task.cfg.long, task.long_trajectory(harmonics)
    facts = read_json(task.store.require(task.seeds) / REPORT)
    seconds = settings.factor * task.cfg.selection.count * facts["cpu_seconds"] / facts["count"]
    problem = SeedProblem(task.constraints, trajectory, settings.samples)
    made = make_long(problem, settings.steps, seconds, task.random(f"long {harmonics}"), report)
    library = measured(task.constraints, trajectory, made.coefficients, f"long-{harmonics}")
    library.save(folder / LIBRARY)
    known = {"condition": float(library.fitness[0]), "starts": made.attempts}
    write_json(folder / REPORT, {**known, "cpu_seconds": made.cpu_seconds, "allotted_seconds": seconds})


def _compare(task: Task, folder: Path, work: Path) -> None:
    sets, tests = _excitation_sets(task), (task.trajectory, _tests(task))
    settings = study_settings(task.cfg.identification)
    jobs = [
        partial(study.compare, task.body, {name: family}, tests, settings, task.random("identification"))
        for name, family in sets.items()
    ]
    parts = run_jobs("identification", jobs, task.cfg.parallel.workers, len(sets) * settings.repeats)
    for name, frames in zip((RESULTS, SETS), zip(*parts)):
        write_parquet(folder / name, arrow(pd.concat(frames, ignore_index=True)))


def _excitation_sets(task: Task) -> dict[str, tuple[Trajectory, Tensor]]:
    """Family and coefficients of every set that is compared."""
    sets = {}
    for h in task.cfg.long.harmonics:
        library = Library.load(task.store.require(task.long(h)) / LIBRARY, task.arm)
        sets[f"long-{h}"] = (task.long_trajectory(h), library.coefficients)
    for name in ["seeds", *task.cfg.gan]:
        library = Library.load(task.store.require(task.selection(name)) / LIBRARY, task.arm)
        sets[name] = (task.trajectory, library.coefficients)
    return sets


def _tests(task: Task) -> Tensor:
    """Random valid trajectories that no compared set contains or generated."""
    from sidegan.seeds.problem import SeedProblem

    problem = SeedProblem(task.constraints, task.trajectory)
    generator = torch.Generator().manual_seed(task.number("tests"))
    found: list[Tensor] = []
    for _ in range(100):
        c = problem.start(task.cfg.identification.tests, generator, TEST_REACH)
        found.append(c[check(task.constraints, task.trajectory, c).valid])
        if sum(map(len, found)) >= task.cfg.identification.tests:
            return torch.cat(found)[: task.cfg.identification.tests]
    raise InfeasibleError(
        "random trajectories are almost never valid in this workspace: there is nothing to test on"
    )


def _generators(task: Task) -> dict[str, dict[str, Any]]:
    """What is known of the seeds and of every generator."""
    known = {"seeds": summary(_seeds(task))}
    for name, settings in task.cfg.gan.items():
        history = read_json(task.store.require(task.gan(name, settings)) / HISTORY)
        last, kept = history[-1], read_json(task.store.require(task.library(name)) / REPORT)
        # A library holds what is valid: its condition is not that of all that the generator makes.
        known[name] = last | kept | {"condition": last["condition"], "condition_valid": kept["condition"]}
    return known


def finite(row: dict[str, Any]) -> dict[str, Any]:
    """The row with None in place of what is not a finite number, as JSON wants it."""
    return {k: None if isinstance(v, float) and not math.isfinite(v) else v for k, v in row.items()}
