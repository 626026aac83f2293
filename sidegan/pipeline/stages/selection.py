"""Stages library and selection: valid trajectories of each generator, and the sets picked from pools."""

from collections.abc import Iterable
from dataclasses import dataclass
from functools import partial

import numpy as np

from sidegan.base.storage import write_json
from sidegan.design.selection import choose
from sidegan.library import LIBRARY, Library
from sidegan.library.draw import draw_valid
from sidegan.library.measure import library_of, summary
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import REPORT, RunContext
from sidegan.pipeline.stages import Stage
from sidegan.pipeline.stages.baselines import GRADIENT, gradient_set, long_family, long_trajectory, random_set
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generator, generators, load_generator

RANDOM, SEEDS = "random", "seeds"
_TOGETHER = 20_000  # largest sample of a library and the seeds for their joint diversity


def library(run: RunContext, name: str, training: int) -> Artifact:
    """Valid trajectories of a generator."""
    inputs = {"gan": generator(run, name, training)}
    if run.cfg.gan[name].seeded:
        inputs["seeds"] = seed_set(run)  # for their joint diversity
    make = partial(_draw, name=name, training=training)
    return run.artifact("library", name, make, run.cfg.library, inputs, training=training)


def _draw(run: RunContext, build: Build, name: str, training: int) -> None:
    settings = run.cfg.library
    network = load_generator(run, generator(run, name, training))
    sample = network.stream(run.number(f"library {name}", training))
    draws = draw_valid(sample, run.cell.check, settings, f"drawn from {name}", build.report)
    made = library_of(run.cell.constraints, run.cell.trajectory, draws.coefficients, name)
    made.save(build.folder / LIBRARY)
    facts = summary(made) if len(made) else {"count": 0}
    facts = {key: x for key, x in facts.items() if key != "valid"}
    if run.cfg.gan[name].seeded:
        facts |= _union(run, made, np.random.default_rng(run.number(f"union {name}", training)))
    share = {"drawn": draws.drawn, "valid_share": draws.valid / draws.drawn}
    write_json(build.folder / REPORT, share | facts)


def _union(run: RunContext, made: Library, random: np.random.Generator) -> dict[str, float]:
    """Joint diversity of the library and the seeds."""
    seeds = run.load(seed_set(run))
    order = random.permutation(len(seeds) + len(made))[:_TOGETHER]
    of_seeds = order < len(seeds)
    both = seeds.take(order[of_seeds]).merge(made.take(order[~of_seeds] - len(seeds)))
    mixed = summary(both.take((~of_seeds).argsort(kind="stable").argsort()))  # in the random order again
    return {f"union_{key}": mixed[key] for key in ("distance", "distance_diagonal", "rank")}


@dataclass(frozen=True)
class Pool:
    """Trajectories that a set can be picked from."""

    name: str  # ``random``, ``seeds``, or a variant
    training: int | None  # of the variant; None for others
    parts: tuple[Artifact, ...]  # artifacts with the trajectories

    @property
    def inputs(self) -> dict[str, Artifact]:
        """The parts, as inputs of an artifact."""
        return {part.maker: part for part in self.parts}

    def load(self, run: RunContext) -> Library:
        """All trajectories."""
        return run.load(*self.parts)


@dataclass(frozen=True)
class ExcitationSet:
    """Trajectories that an arm executes for its identification."""

    name: str  # of the pool, or ``long-<harmonics>``
    training: int | None  # of the variant; None for others
    family: Trajectory
    source: Artifact  # with the trajectories


def pools(run: RunContext) -> list[Pool]:
    """The pools of the paper: random trajectories, the seeds, and the seeds with each generator's library.

    If the seeds are not by gradients, short trajectories that are, as the single long one is.
    """
    seeds = seed_set(run)
    short = [] if run.cfg.seeds.method == GRADIENT else [Pool(GRADIENT, None, (gradient_set(run),))]
    grown = [Pool(name, k, (seeds, library(run, name, k))) for name, k in generators(run)]
    return [Pool(RANDOM, None, (random_set(run),)), *short, Pool(SEEDS, None, (seeds,)), *grown]


def whole_sets(run: RunContext) -> list[Pool]:
    """The seeds, and each generator's library without the seeds."""
    made = [Pool(name, training, (library(run, name, training),)) for name, training in generators(run)]
    return [Pool(SEEDS, None, (seed_set(run),)), *made]


def selection(run: RunContext, pool: Pool) -> Artifact:
    """The set picked from a pool."""
    method = run.cfg.selection.method
    label = pool.name if method == "greedy" else f"{pool.name}-{method}"
    make = partial(_pick, pool=pool)
    return run.artifact("selection", label, make, run.cfg.selection, pool.inputs, training=pool.training)


def generated_alone(run: RunContext) -> list[Pool]:
    """Each generator's library without the seeds, as a pool to pick from."""
    return [Pool(f"{pool.name}-alone", pool.training, pool.parts) for pool in whole_sets(run)[1:]]


def picked(run: RunContext, pools: Iterable[Pool]) -> list[ExcitationSet]:
    """The sets picked from pools."""
    return [
        ExcitationSet(pool.name, pool.training, run.cell.trajectory, selection(run, pool)) for pool in pools
    ]


def excitation_sets(run: RunContext) -> list[ExcitationSet]:
    """The sets to compare: the single long trajectories, and the picks from each pool."""
    long = [
        ExcitationSet(f"long-{h}", None, long_family(run, h), long_trajectory(run, h))
        for h in run.cfg.long.harmonics
    ]
    return [*long, *picked(run, pools(run))]


def _pick(run: RunContext, build: Build, pool: Pool) -> None:
    cell, library = run.cell, pool.load(run)
    order = choose(run.cfg.selection, cell.body, cell.trajectory, library.coefficients, library.diagonal)
    library.take(order).save(build.folder / LIBRARY)


STAGES = {
    "library": Stage(lambda run: [library(run, name, k) for name, k in generators(run)]),
    "selection": Stage(lambda run: [selection(run, pool) for pool in [*pools(run), *generated_alone(run)]]),
}
