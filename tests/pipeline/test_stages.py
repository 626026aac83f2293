import json
import math

import pandas as pd
import pytest

from sidegan.errors import ArtifactError, InfeasibleError, RobotError
from sidegan.gan import TrajectoryGenerator
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stage import finite, words
from sidegan.pipeline.stages import stage
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
def once(outputs, tmp_path_factory):
    """Folder of a run of a whole tiny experiment."""
    folder = tmp_path_factory.mktemp("once")
    run_stages(tiny(f"outputs={outputs}"), folder, "first")
    return folder


@pytest.fixture
def made(once, outputs):
    """The task of that run."""
    return task(outputs)


def task(root, *overrides):
    config = tiny(f"outputs={root}", *overrides)
    return Task(config, Store(root))


def artifacts(made):
    """Every artifact's folder, by stage, with what tells whether it was made anew."""
    folders = {name: map(made.store.require, stage(name).artifacts(made)) for name in made.cfg.stages}
    return {name: {folder: folder.stat().st_ino for folder in part} for name, part in folders.items()}


def test_every_stage_leaves_its_artifacts(made, outputs):
    counts = {name: len(part) for name, part in artifacts(made).items()}
    assert counts == {
        "seeds": 1,
        "surrogates": 2,  # with the generator whose output they learn from
        "gan": 3,
        "library": 3,
        "random": 1,
        "long": 2,
        "selection": 5,
        "identification": 7,
        "plant": 7,
        "table": 0,
    }
    for part in artifacts(made).values():
        for folder in part:
            assert not list(folder.parent.glob(f"{folder.name}.work"))
            assert not list(folder.parent.glob(f".{folder.name}*.tmp"))


def test_the_experiment_leaves_table_1_and_its_figures(once):
    table = pd.read_csv(once / "table1.csv", index_col=0)
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
        assert (once / name).stat().st_size > 0


def test_a_second_run_makes_nothing_and_prints_the_same(once, made, outputs, tmp_path, capsys):
    before = artifacts(made)
    run_stages(tiny(f"outputs={outputs}"), tmp_path, "second")
    assert artifacts(made) == before
    assert (tmp_path / "table1.csv").read_bytes() == (once / "table1.csv").read_bytes()
    out = capsys.readouterr().out
    assert "Table I" in out and "seeds + eigen" in out


def test_the_libraries_hold_what_is_valid(made):
    for name in made.cfg.gan:
        trajectories, report = made.load(library(made, name, 0)), made.report(library(made, name, 0))
        assert len(trajectories) == made.cfg.library.count
        assert check(made.constraints, made.trajectory, trajectories.coefficients).valid.all()
        assert 0 < report["valid_share"] <= 1 and report["drawn"] >= len(trajectories)


def test_the_selections_are_of_seeds_and_libraries(made):
    seeds = made.load(seed_set(made))
    rows = {tuple(row) for row in seeds.coefficients.flatten(1).tolist()}
    for pool in pools(made)[1:]:
        chosen = made.load(selection(made, pool))
        assert len(chosen) == made.cfg.selection.count
        for source, row in zip(chosen.source, chosen.coefficients.flatten(1).tolist()):
            assert (tuple(row) in rows) == (source != pool.name or pool.name == "seeds")


def test_the_generators_are_the_arms_own(made):
    path = made.store.require(generator(made, "eigen", 0))
    loaded = TrajectoryGenerator.load(path / "generator.pt", made.arm)
    assert loaded.trajectory == made.trajectory and loaded.variant == "eigen"
    history = json.loads((path / "history.json").read_text())
    assert len(history) == made.cfg.scale.gan_epochs
    with pytest.raises(ArtifactError, match="planar2"):
        TrajectoryGenerator.load(path / "generator.pt", load_robot("kuka_lwr4"))


def test_the_sets_last_equally_long_in_the_facts(made):
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
        ("identification", "long/planar2-gradient5-32s-3h-seed0"),
        ("table", "identification/planar2-long-3-seed0"),
    ],
)
def test_a_stage_without_its_inputs_names_what_is_missing(stage, missing, tmp_path):
    config = tiny(f"outputs={tmp_path}", f"stages=[{stage}]")
    with pytest.raises(ArtifactError) as error:
        run_stages(config, tmp_path / "run", "alone")
    assert f"there is no {missing}" in str(error.value)
    assert f"run stage {missing.split('/')[0]} first" in str(error.value)


def test_a_changed_seed_set_is_named_as_the_difference(made, outputs, tmp_path):
    config = tiny(f"outputs={outputs}", "stages=[selection]", "seeds.attempts=7")
    with pytest.raises(ArtifactError, match=r"settings\.seeds\.attempts is \d+, not 7"):
        run_stages(config, tmp_path, "other")


def test_a_change_of_one_variant_makes_that_variant_anew(made, outputs, tmp_path):
    before, change = artifacts(made), "gan.diagonal.weights.distance=3"
    run_stages(tiny(f"outputs={outputs}", "stages=[gan]", change), tmp_path, "third")
    after = artifacts(task(outputs, "stages=[gan]", change))
    (new,) = set(after["gan"]) - set(before["gan"])
    assert new.name.startswith("planar2-diagonal")


def test_a_library_that_stays_short_is_told(made, outputs, tmp_path, caplog):
    few = ("stages=[library]", "gan=vanilla", "library.batch=5", "library.draws=10")
    run_stages(tiny(f"outputs={outputs}", *few), tmp_path, "short")
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
    assert words({"condition": 28864.2}) == "condition 28860"


EXACT = ("gan=exact", "gan.exact.exact.samples=20")


def test_an_exact_variant_needs_no_surrogates_and_gets_its_rows(made, outputs, tmp_path):
    exact = task(outputs, *EXACT, "library.draws=3000")
    run_stages(exact.cfg, tmp_path, "exact")
    assert not artifacts(exact)["surrogates"]
    table = pd.read_csv(tmp_path / "table1.csv", index_col=0)
    assert any("exact" in column for column in table.columns)
    (folder,) = artifacts(exact)["gan"]
    assert "seeds" not in json.loads((folder / "stamp.json").read_text())["inputs"]


def test_polished_libraries_are_better(outputs, tmp_path):
    median = {}
    for steps in (0, 15):
        polish = (f"library.polish={steps}", "library.count=20")
        exact = task(outputs, *EXACT, "stages=[gan,library]", *polish)
        run_stages(exact.cfg, tmp_path, "polish")
        median[steps] = exact.load(library(exact, "exact", 0)).fitness.median()
    assert median[15] < 0.7 * median[0]


def test_an_arm_that_cannot_exist_is_refused_before_any_work(tmp_path, planar):
    urdf = tmp_path / "arm.urdf"
    urdf.write_text(planar.urdf.read_text().replace('ixx="0.045"', 'ixx="-5"'))
    with pytest.raises(RobotError, match="not physically consistent: link 'upper_arm'"):
        run_stages(tiny(f"outputs={tmp_path}", f"robot.name={urdf}"), tmp_path / "run", "run")
    assert not (tmp_path / "seeds").exists()
