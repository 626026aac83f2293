import json
import math

import pandas as pd
import pytest

from sidegan.errors import ArtifactError, InfeasibleError
from sidegan.gan import TrajectoryGenerator
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stage import finite, words
from sidegan.pipeline.stages.identification import identification
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.pools import pools
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import excitation_sets, selection
from sidegan.pipeline.stages.training import generator
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from sidegan.robot import load_robot
from sidegan.validity import check
from tests.tiny import tiny


@pytest.fixture(scope="module")
def once(tmp_path_factory):
    """Root of a whole tiny experiment."""
    root = tmp_path_factory.mktemp("outputs")
    config = tiny(f"outputs={root}")
    run_stages(config, root / "runs" / "first", "first")
    return root


def task(root, *overrides):
    config = tiny(f"outputs={root}", *overrides)
    return Task(config, Store(root))


def artifacts(root):
    """Every artifact's folder with the time its stamp was written."""
    return {path.parent: path.stat().st_mtime_ns for path in root.glob("*/*/stamp.json")}


def stamp_files(root, stage):
    return sorted(path.parent.name for path in root.glob(f"{stage}/*/stamp.json"))


def test_every_stage_leaves_its_artifacts(once):
    counts = {
        "seeds": 1,
        "surrogates": 1,
        "gan": 3,
        "library": 3,
        "random": 1,
        "long": 2,
        "selection": 5,
        "identification": 7,
    }
    assert {stage: len(stamp_files(once, stage)) for stage in counts} == counts
    assert not list(once.glob("*/*.work")) and not list(once.glob("*/.*.tmp"))


def test_the_experiment_leaves_table_1_and_its_figures(once):
    folder = once / "runs" / "first"
    table = pd.read_csv(folder / "table1.csv", index_col=0)
    assert list(table.columns) == [
        "single long, 3 harmonics",
        "single long, 12 harmonics",
        "random valid",
        "seeds",
        "seeds + vanilla",
        "seeds + eigen",
        "seeds + diagonal",
    ]
    assert table.loc["Simulator"].str.contains("±").all()
    for name in ("table1.md", "joints.csv", "sets.csv", "generators.md", "training.png", "nmse.png"):
        assert (folder / name).stat().st_size > 0


def test_a_second_run_makes_nothing_and_prints_the_same(once, capsys):
    before = artifacts(once)
    run_stages(tiny(f"outputs={once}"), once / "runs" / "second", "second")
    assert artifacts(once) == before
    tables = [(once / "runs" / run / "table1.csv").read_bytes() for run in ("first", "second")]
    assert tables[0] == tables[1]
    out = capsys.readouterr().out
    assert "Table I" in out and "seeds + eigen" in out


def test_the_libraries_hold_what_is_valid(once):
    made = task(once)
    for name in made.cfg.gan:
        trajectories, report = made.load(library(made, name, 0)), made.report(library(made, name, 0))
        assert len(trajectories) == made.cfg.library.count
        assert check(made.constraints, made.trajectory, trajectories.coefficients).valid.all()
        assert 0 < report["valid_share"] <= 1 and report["drawn"] >= len(trajectories)


def test_the_selections_are_of_seeds_and_libraries(once):
    made = task(once)
    seeds = made.load(seed_set(made))
    rows = {tuple(row) for row in seeds.coefficients.flatten(1).tolist()}
    for pool in pools(made)[1:]:
        chosen = made.load(selection(made, pool))
        assert len(chosen) == made.cfg.selection.count
        for source, row in zip(chosen.source, chosen.coefficients.flatten(1).tolist()):
            assert (tuple(row) in rows) == (source != pool.name or pool.name == "seeds")


def test_the_generators_are_the_arms_own(once):
    made = task(once)
    path = made.store.require(generator(made, "eigen", 0))
    loaded = TrajectoryGenerator.load(path / "generator.pt", made.arm)
    assert loaded.trajectory == made.trajectory and loaded.variant == "eigen"
    history = json.loads((path / "history.json").read_text())
    assert len(history) == made.cfg.scale.gan_epochs
    with pytest.raises(ArtifactError, match="planar2"):
        TrajectoryGenerator.load(path / "generator.pt", load_robot("kuka_lwr4"))


def test_the_sets_last_equally_long_in_the_facts(once):
    made = task(once)
    facts = pd.concat(
        [made.frame(identification(made, one), "facts.parquet") for one in excitation_sets(made)]
    )
    count, period = made.cfg.selection.count, made.cfg.trajectory.period
    short = facts[~facts["set"].str.startswith("long")]
    assert (short.duration == count * period).all()
    assert (facts[facts["set"].str.startswith("long")].duration == made.cfg.long.period).all()


@pytest.mark.parametrize(
    ("stage", "missing"),
    [
        ("surrogates", "seeds/planar2-gradient-seed0"),
        ("gan", "seeds/planar2-gradient-seed0"),
        ("library", "gan/planar2-vanilla-seed0-training0"),
        ("selection", "random/planar2-random-seed0"),
        ("identification", "long/planar2-32s-3h-seed0"),
        ("table", "identification/planar2-long-3-seed0"),
    ],
)
def test_a_stage_without_its_inputs_names_what_is_missing(stage, missing, tmp_path):
    config = tiny(f"outputs={tmp_path}", f"stages=[{stage}]")
    with pytest.raises(ArtifactError) as error:
        run_stages(config, tmp_path / "run", "alone")
    assert f"there is no {missing}" in str(error.value)
    assert f"run stage {missing.split('/')[0]} first" in str(error.value)


def test_a_changed_seed_set_is_named_as_the_difference(once):
    config = tiny(f"outputs={once}", "stages=[selection]", "seeds.steps=21")
    with pytest.raises(ArtifactError, match=r"settings\.seeds\.steps is 20, not 21"):
        run_stages(config, once / "runs" / "other", "other")


def test_a_change_of_one_variant_makes_that_variant_anew(once):
    before = artifacts(once)
    config = tiny(f"outputs={once}", "stages=[gan]", "gan.diagonal.weights.distance=3")
    run_stages(config, once / "runs" / "third", "third")
    made = set(artifacts(once)) - set(before)
    assert [folder.name.startswith("planar2-diagonal") for folder in made] == [True]


def test_a_library_that_stays_short_is_told(once, caplog):
    config = tiny(f"outputs={once}", "stages=[library]", "gan=vanilla", "library.batch=5", "library.draws=10")
    run_stages(config, once / "runs" / "short", "short")
    assert "in 10 draws, 40 were wanted" in caplog.text


def test_a_home_that_is_not_feasible_is_refused_before_any_work(tmp_path):
    config = tiny(f"outputs={tmp_path}", "stages=[seeds]", "trajectory.home=[0, 3.1]")
    with pytest.raises(InfeasibleError, match="home position"):
        run_stages(config, tmp_path / "run", "home")
    assert not list(tmp_path.glob("seeds/*"))


def test_reports_hold_only_what_json_can_say():
    row = finite({"a": math.nan, "b": math.inf, "c": 1.5, "d": 2, "e": "x"})
    assert row == {"a": None, "b": None, "c": 1.5, "d": 2, "e": "x"}
    assert words({"a": 1.23456, "b": 2}) == "a 1.235, b 2"


def test_an_exact_variant_needs_no_surrogates_and_gets_its_rows(tmp_path):
    config = tiny(f"outputs={tmp_path}", "gan=exact", "gan.exact.exact.samples=20", "library.draws=3000")
    run_stages(config, tmp_path / "run", "exact")
    assert not stamp_files(tmp_path, "surrogates")
    table = pd.read_csv(tmp_path / "run" / "table1.csv", index_col=0)
    assert any("exact" in column for column in table.columns)
    stamp = json.loads(next(tmp_path.glob("gan/*/stamp.json")).read_text())
    assert "seeds" not in stamp["inputs"]


def test_polished_libraries_are_better(tmp_path):
    stages = "stages=[seeds,surrogates,gan,library]"
    median = {}
    for steps in (0, 15):
        config = tiny(
            f"outputs={tmp_path}", "gan=exact", stages, f"library.polish={steps}", "library.count=20"
        )
        run_stages(config, tmp_path / "run", "polish")
        made = Task(config, Store(tmp_path))
        median[steps] = made.load(library(made, "exact", 0)).fitness.median()
    assert median[15] < 0.7 * median[0]
