"""Stages by what they do: planted answers, tests unlike what was learned, invalid motions that are missing.

A stage that ignored its criterion, its check or the difference between training and test would still leave
plausible files; nothing else than these tests would notice.
"""

from dataclasses import dataclass, replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from scipy.spatial.distance import cdist, pdist

from sidegan.base.arrays import flatten
from sidegan.base.storage import read_json
from sidegan.design.prediction import TorqueNoise
from sidegan.identification import study
from sidegan.library import LIBRARY, Library
from sidegan.library.measure import library_of
from sidegan.pipeline.context import REPORT, RESULTS, RunContext
from sidegan.pipeline.stages import baselines, discussion
from sidegan.pipeline.stages import identification as plants
from sidegan.pipeline.stages.baselines import natural_set, random_set, random_valid, searched_sets
from sidegan.pipeline.stages.discussion import density
from sidegan.pipeline.stages.identification import identification, plant
from sidegan.pipeline.stages.measures import measures
from sidegan.pipeline.stages.selection import ExcitationSet, Pool, selection
from sidegan.seeding import seeds_recipe

TIGHT = ("workspace.regions=[{plane:{normal:[1,0,0],offset:-0.3}}]",)  # a wall that random motions hit


def drawn(context, count, seed=5, reach=0.8):
    """Random trajectories, valid or not."""
    return context.cell.problem.start(count, np.random.default_rng(seed), reach)


@dataclass(frozen=True)
class Planted(Pool):
    """A pool that holds what it is given."""

    library: Library | None = None

    def load(self, context):
        return self.library


@pytest.fixture
def planted(context):
    """A context, a pool of 60 trajectories, and the places of the only six of them that move."""
    made = context()
    strong, places = drawn(made, 6), [17, 23, 31, 40, 48, 59]
    c = 0.02 * drawn(made, 60, seed=6)
    c[places] = strong
    pool = Planted("planted", None, (), library_of(made.cell.constraints, made.cell.trajectory, c, "planted"))
    return made, pool, places


@pytest.mark.parametrize(("method", "least"), [("greedy", 3), ("d_optimal", 6), ("a_optimal", 6)])
def test_a_selection_finds_the_exciting_trajectories(planted, build, method, least):
    made, pool, places = planted
    made = made.with_settings(selection=replace(made.cfg.selection, method=method))
    selection(made, pool).make(build)
    chosen = Library.load(build.folder / LIBRARY, made.cell.arm).coefficients
    apart = cdist(flatten(chosen, 1), flatten(pool.library.coefficients[places], 1))
    moving = int((apart < 1e-9).any(1).sum())
    assert least <= moving and (method != "greedy" or moving < 6)  # greedy: what differs most is one at rest


def test_random_trajectories_are_checked_and_invalid_ones_dropped(context, build):
    made = context(*TIGHT)
    share = made.cell.check(drawn(made, 400)).valid.mean()
    assert 0.1 < share < 0.9, "the workspace tells nothing"
    random_set(made).make(build)
    library = Library.load(build.folder / LIBRARY, made.cell.arm)
    assert made.cell.check(library.coefficients).valid.all()
    assert read_json(build.folder / REPORT)["drawn"] > len(library)


def test_natural_draws_reach_as_far_as_99_percent_are_valid(context, build):
    made = context(*TIGHT)
    natural_set(made).make(build)
    library, report = Library.load(build.folder / LIBRARY, made.cell.arm), read_json(build.folder / REPORT)
    assert made.cell.check(library.coefficients).valid.all()
    assert report["valid_share"] >= 0.99 and len(library) == 400 * report["valid_share"]
    farther = made.cell.check(1.1 * library.coefficients).valid
    assert 0.5 < farther.mean() < 0.99
    use = made.cell.problem.limit_use(library.coefficients)
    np.testing.assert_allclose(use, report["reach"], rtol=0.02)


def test_longer_searches_are_better_and_keep_to_the_seeds_box(context, build, monkeypatch):
    monkeypatch.setattr(baselines, "_SEARCHED", 12)
    made = context()
    assert not any(name.startswith(baselines.BOXED) for name in searched_sets(made))  # seeds without a box
    made = made.with_settings(seeds=seeds_recipe("paper", box=0.2))
    noise, found = TorqueNoise.constant(made.cell.body, made.cfg.identification.constant), {}
    for name, artifact in searched_sets(made).items():
        artifact.make(build)
        library = Library.load(build.folder / LIBRARY, made.cell.arm)
        assert len(library) == 12 and library.valid.all() and build.costs["cpu_each"] > 0
        error = baselines.prediction(made, noise).of_draws(library.coefficients, 6).mean()
        found[name] = np.median(library.fitness), error, np.abs(library.coefficients).max()
    assert found["search-160"][0] < 0.5 * found["search-10"][0]
    assert found["boxed-160"][1] < 0.7 * found["boxed-10"][1]
    assert found["boxed-160"][2] <= 0.2 < found["search-160"][2]


def test_sets_are_measured_against_half_of_the_seeds(planted, build, monkeypatch):
    """Seeds, the same ones shifted, and ones that hardly move: each is told from the others."""
    made, _, _ = planted
    seeds = library_of(made.cell.constraints, made.cell.trajectory, drawn(made, 80, reach=0.4), "seeds")
    monkeypatch.setattr(RunContext, "load", lambda self, *artifacts: seeds)

    def measures_of(name, c):
        library = library_of(made.cell.constraints, made.cell.trajectory, c, name)
        measures(made, Planted(name, None, (), library)).make(build)
        return read_json(build.folder / REPORT), pd.read_parquet(build.folder / RESULTS)

    own, draws = measures_of("seeds", seeds.coefficients)
    shifted, _ = measures_of("eigen", seeds.coefficients + 0.3)
    small, _ = measures_of("exact", 0.1 * seeds.coefficients)
    assert own["nearest_seed"] > 0.1 and own["coverage"] > 0.8 and abs(own["told_apart"] - 0.5) < 0.15
    assert shifted["cosine"] > own["cosine"] + 0.1 and shifted["told_apart"] > 0.9
    assert small["error_constant"] > 10 * own["error_constant"] and small["norm"] < 0.2 * own["norm"]
    assert list(draws.noise.value_counts()) == [200] * 3 and set(draws["set"]) == {"seeds"}
    mean = draws.groupby("noise").nmse.mean()
    assert {key: own[key] for key in mean.index} == pytest.approx(mean.to_dict())
    few, none = measures_of("diagonal", seeds.coefficients[:5])  # fewer than a set has
    assert few["error"] is None and none.nmse.isna().all() and "cosine" in few


@pytest.fixture
def executed(context, monkeypatch):
    """A context in a tight workspace, and a set of valid motions that a model is to be identified from."""
    made = context(*TIGHT)
    c = random_valid(made, 6, "learned").coefficients
    library = library_of(made.cell.constraints, made.cell.trajectory, c, "planted")
    monkeypatch.setattr(RunContext, "load", lambda self, *artifacts: library)
    return made, ExcitationSet("planted", None, made.cell.trajectory, random_set(made)), c


def refuse_tests(made, learned, tests):
    """Tests must be valid motions that the model has not learned from."""
    assert len(tests) == made.cfg.identification.tests
    assert made.cell.check(tests).valid.all()
    assert cdist(flatten(tests, 1), flatten(learned, 1)).min() > 0.1


def test_identification_is_tested_on_unseen_valid_motions(executed, build, monkeypatch):
    made, excitation, learned = executed
    drawn_errors, seen = study.drawn_errors, {}

    def watched(body, name, family, tests, *rest):
        seen.update(learned=family, tests=tests)
        return drawn_errors(body, name, family, tests, *rest)

    monkeypatch.setattr(study, "drawn_errors", watched)
    identification(made, excitation).make(build)
    (_, c), (_, tests) = seen["learned"], seen["tests"]
    np.testing.assert_array_equal(c, learned)
    refuse_tests(made, learned, tests)


def test_the_plant_is_scored_on_unseen_motions(executed, build, monkeypatch):
    made, excitation, learned = executed
    motions, recorded, estimated, scored = [], [], [], []
    execute, estimate, score = plants.recorded, plants.estimate, plants.score

    def watched(machine, family, c, *rest):
        motions.append(c)
        recorded.append(execute(machine, family, c, *rest))
        return recorded[-1]

    monkeypatch.setattr(plants, "recorded", watched)
    monkeypatch.setattr(plants, "estimate", lambda m, model, x: estimated.append(x) or estimate(m, model, x))
    monkeypatch.setattr(plants, "score", lambda model, p, x: scored.append(x) or score(model, p, x))
    plant(made, excitation).make(build)
    np.testing.assert_array_equal(motions[0], learned)
    refuse_tests(made, learned, motions[1])
    for (*_, torque), data in zip(recorded, (estimated[0], scored[0])):
        taken = np.stack([part.torque for part in data])
        np.testing.assert_array_equal(taken, torque)


def test_narrow_density_estimates_sample_near_the_seeds(context, build, monkeypatch):
    made = context("discussion.bandwidths=[1e-6,1]", "discussion.draws=20", experiment="reproduction")
    c = drawn(made, 40, reach=0.5)
    monkeypatch.setattr(discussion, "training_seeds", lambda context: SimpleNamespace(coefficients=c))
    density(made).make(build)
    narrow, wide = pd.read_parquet(build.folder / RESULTS).from_seed / pdist(flatten(c, 1)).min()
    assert narrow < 1e-4 and 0.1 < wide < 10
