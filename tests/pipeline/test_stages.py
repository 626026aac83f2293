"""A whole tiny experiment: what every stage leaves, and what is made anew after a change."""

import json
from dataclasses import replace

import pandas as pd
import pytest

from experiments.artifacts import Artifacts, comparison
from experiments.exp1 import table1
from sidegan.base.arrays import flatten
from sidegan.pipeline.compose import composed
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import stage
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import library, pools, selection
from sidegan.pipeline.store import Store
from sidegan.validity import check
from tests.tiny import TINY, tiny


@pytest.fixture(scope="module")
def made(outputs, tmp_path_factory):
    """The context of a run of a whole tiny experiment, which has made all but the table."""
    config = tiny(f"outputs={outputs}", "gan=all")
    stages = [name for name in config.stages if name != "table"]
    run_stages(replace(config, stages=stages), tmp_path_factory.mktemp("first"), "first")
    return RunContext(config, Store(outputs))


def artifacts(made):
    """Every artifact's folder, by stage, with what tells whether it was made anew."""
    folders = {name: map(made.store.require, stage(name).artifacts(made)) for name in made.cfg.stages}
    return {name: {folder: folder.stat().st_ino for folder in part} for name, part in folders.items()}


MADE = {"seeds": 1, "surrogates": 2, "gan": 5, "library": 5, "random": 5, "measures": 11}
MADE |= {"long": 2, "selection": 7, "identification": 9, "plant": 9, "table": 0}
COLUMNS = ["single long, 3 harmonics", "single long, 12 harmonics", "random valid", "seeds"]
COLUMNS += [f"seeds + {name}" for name in ("vanilla", "eigen", "diagonal", "prediction", "exact")]
FILES = ("table1.md", "draws.md", "joints.csv", "sets.csv", "generators.md", "likeness.md", "results.csv")
FILES += ("training.*", "nmse.*", "coefficients.*")


def test_every_stage_makes_its_artifacts(made):
    assert {name: len(part) for name, part in artifacts(made).items()} == MADE
    for folder in (folder for part in artifacts(made).values() for folder in part):
        left = [*folder.parent.glob(f"{folder.name}.work"), *folder.parent.glob(f".{folder.name}*.tmp")]
        assert left == []


def test_a_second_run_reuses_everything_for_the_tables_of_the_experiment(made, tmp_path, capsys):
    before = artifacts(made)
    run_stages(made.cfg, tmp_path, "second")
    assert artifacts(made) == before
    out = capsys.readouterr().out
    assert "Table I" in out and "seeds + eigen" in out
    table = pd.read_csv(tmp_path / "table1.csv", index_col=0)
    assert list(table.columns) == COLUMNS and table.loc["Simulator"].str.contains("±").all()
    assert all(list(tmp_path.glob(name)) for name in FILES)
    assert list(pd.read_csv(tmp_path / "results.csv").columns[:2]) == ["name", "nMSE"]
    found = Artifacts(made)
    again = table1(found.errors, found.plant, found.expected, found.constant)
    assert again.reset_index().to_csv(index=False) == (tmp_path / "table1.csv").read_text()


def test_the_libraries_contain_valid_trajectories(made):
    for name in made.cfg.gan:
        trajectories, report = made.load(library(made, name, 0)), made.report(library(made, name, 0))
        assert len(trajectories) == made.cfg.library.count
        assert check(made.cell.constraints, made.cell.trajectory, trajectories.coefficients).valid.all()
        assert 0 < report["valid_share"] <= 1 and report["drawn"] >= len(trajectories)


def test_selections_come_from_seeds_and_libraries(made):
    seeds = made.load(seed_set(made))
    rows = {tuple(row) for row in flatten(seeds.coefficients, 1)}
    for pool in pools(made)[1:]:
        chosen = made.load(selection(made, pool))
        assert len(chosen) == made.cfg.selection.count
        for source, row in zip(chosen.source, flatten(chosen.coefficients, 1)):
            assert (tuple(row) in rows) == (source != pool.name or pool.name == "seeds")


def test_the_exact_variant_does_not_use_seeds(made):
    (folder,) = (artifact for artifact in artifacts(made)["gan"] if artifact.name.startswith("planar2-exact"))
    assert "seeds" not in json.loads((folder / "params.json").read_text())["inputs"]
    alone = RunContext(tiny("gan=exact", "stages=[surrogates]"), made.store)
    assert artifacts(alone) == {"surrogates": {}}


def test_the_page_finds_the_artifacts_of_every_condition(outputs, tmp_path):
    words = "+experiment=reproduction", *TINY, f"outputs={outputs}", "stages=[seeds]"
    for name in ("ours", "gradient"):
        run_stages(composed(*words, f"condition={name}"), tmp_path / name, name)
    words = *words, "condition=ours"  # of the command: another one takes its place
    both = comparison(RunContext(composed(*words, "conditions=[ours,gradient]"), Store(outputs), words))
    assert both["gradient"].cfg.seeds.method == "gradient"
    assert [made.cfg.condition.name for made in both.values()] == list(both) == ["ours", "gradient"]
    assert all(made.seeds["condition"] > 1 for made in both.values())
