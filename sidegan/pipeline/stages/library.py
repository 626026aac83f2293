"""Stage library: valid trajectories of each generator."""

import logging
from functools import partial

import numpy as np

from sidegan.base.storage import write_json
from sidegan.library import LIBRARY, Library
from sidegan.library.draw import draw_valid
from sidegan.library.measure import measured, summary
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import REPORT, RunContext
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generator, generators, load_generator

log = logging.getLogger(__name__)

_TOGETHER = 20_000  # largest sample of a library and the seeds for their joint diversity


def library(run: RunContext, name: str, training: int) -> Artifact:
    """Valid trajectories of a generator."""
    inputs = {"gan": generator(run, name, training)}
    if run.cfg.gan[name].seeded:
        inputs["seeds"] = seed_set(run)  # for their joint diversity
    return run.artifact(
        "library",
        name,
        partial(_make, name=name, training=training),
        run.cfg.library,
        inputs,
        training=training,
    )


def _make(run: RunContext, build: Build, name: str, training: int) -> None:
    settings = run.cfg.library
    network = load_generator(run, generator(run, name, training))
    sample = network.stream(run.number(f"library {name}", training))
    draws = draw_valid(sample, run.cell.check, settings, f"drawn from {name}", build.report)
    made = measured(run.cell.constraints, run.cell.trajectory, draws.coefficients, name)
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
    shuffled = summary(both.take((~of_seeds).argsort(kind="stable").argsort()))
    return {f"union_{key}": shuffled[key] for key in ("distance", "distance_diagonal", "rank")}


STAGES = {"library": Stage(lambda run: [library(run, name, k) for name, k in generators(run)])}
