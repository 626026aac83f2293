"""A whole tiny experiment: what every stage leaves and what is made anew; one recipe on several arms."""

import json
import subprocess
import sys
from dataclasses import replace

import pandas as pd
import pytest

import sidegan
from experiments import generality, reproduction
from experiments.artifacts import Artifacts, comparison
from experiments.exp1 import table1
from experiments.generality import beside_seeds
from sidegan.base.arrays import flatten
from sidegan.base.storage import write_json
from sidegan.errors import ConfigError
from sidegan.pipeline.artifact import stages_of
from sidegan.pipeline.compose import composed
from sidegan.pipeline.context import REPORT, RunContext
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import measures, stage
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import library, pools, selection
from sidegan.pipeline.store import Store
from tests.refusals import refused
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


def test_starts_of_the_first_shipped_seeds_are_recorded_in_proportion(context, tmp_path):
    """The report has those of the whole file: of 1800 seeds in 2409 starts."""
    report = {"count": 400, "condition": 7.0, "attempts": 2409, "failed": 609, "faults": {}}
    write_json(tmp_path / REPORT, report)
    recorded = seed_set(context()).metrics(tmp_path)
    assert recorded == {"count": 400, "condition": 7.0, "attempts": 535, "failed": 135}


MADE = {"seeds": 1, "surrogates": 2, "gan": 5, "library": 5, "random": 5, "measures": 11}
MADE |= {"long": 2, "selection": 12, "identification": 14, "plant": 9, "table": 0}
COLUMNS = ["single long, 3 harmonics", "single long, 12 harmonics", "random valid", "seeds"]
COLUMNS += [f"seeds + {name}" for name in ("vanilla", "eigen", "diagonal", "prediction", "exact")]
FILES = ("table1.md", "draws.md", "joints.csv", "sets.csv", "generators.md", "likeness.md", "results.csv")
FILES += ("training.*", "nmse.*", "likeness.*", "poses.*")


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


def test_whoever_misses_an_artifact_is_told_of_a_stage_that_makes_it(context):
    run = context("gan=[eigen,diagonal]", experiment="reproduction")
    listed = {name: [*stage(name).artifacts(run)] for name in run.cfg.stages}
    digests = {name: {made.digest for made in part} for name, part in listed.items()}
    for made in (made for part in listed.values() for made in part):
        assert any(made.digest in digests[name] for name in stages_of(made.maker)), made.title


def test_the_libraries_contain_valid_trajectories(made):
    for name in made.cfg.gan:
        trajectories, report = made.load(library(made, name, 0)), made.report(library(made, name, 0))
        assert len(trajectories) == made.cfg.library.count
        assert made.cell.check(trajectories.coefficients).valid.all()
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


def test_conditions_with_the_same_settings_and_rows_that_do_not_compose_are_refused(outputs):
    """A seed of the command is that of both conditions."""
    words = "+experiment=reproduction", *TINY, "seed=3", "condition=ours"
    both = composed(*words, "conditions=[ours,ours_again]")
    with refused(ConfigError, "ours", "ours_again", "same settings"):
        reproduction.check(RunContext(both, Store(outputs), words))
    wrong = {"untrained: gan.eigen": "gan.eigen.epochs=2", "bare: ": "+rows.bare=['seeds=null']"}
    for row, word in wrong.items():
        words = "+experiment=ablation", word
        with refused(ConfigError, row):
            measures.variations(RunContext(composed(*words), Store(outputs), words))
    with refused(ConfigError, "gan=eigen"):
        generality.check(RunContext(composed("+experiment=generality", "gan=exact"), Store(outputs)))


FOREIGN = "long.", "plants.", "selection.", "robot=", "seeds=", "tracking="
OWN = [override for override in TINY if not override.startswith(FOREIGN)]
GIVEN = ("+experiment=generality", "arms=[planar2]", "gan=eigen", *OWN)


def test_one_command_compares_arms(command, outputs, tmp_path):
    folder = tmp_path / "run"
    assert command(*GIVEN, f"outputs={outputs}", f"hydra.run.dir={folder}", "publish=docs") == 0
    table = pd.read_csv(folder / "arms.csv").set_index("generator")
    assert set(table.arm) == {"planar2"} and {"natural", "search-10", "seeds", "eigen"} <= set(table.index)
    assert (table.loc["seeds"].drop(["arm", "mean cosine"]).astype(float) == 1).all()
    assert float(pd.read_csv(folder / "transfer.csv").planar2[0]) == 1  # a library holds what is valid
    page = (tmp_path / "docs" / "generality.md").read_text()
    assert "arms=[planar2]" in page and "| planar2 | 2 | 0 |" in page and len(page.split()) < 600


def test_compared_arms_share_artifacts_with_single_runs(context):
    shared = GIVEN[2:]
    compared = RunContext(composed(*GIVEN), context().store, GIVEN)
    own = composed("+experiment=training", "condition=gradient", "robot=planar2", *shared)
    alone = RunContext(own, context().store, ())
    found = {
        artifact.digest: artifact.title for artifact in measures.STAGES["variations"].artifacts(compared)
    }
    for artifact in (seed_set(alone), library(alone, "eigen", 0)):
        assert found[artifact.digest] == f"planar2 {artifact.title}"


def test_errors_are_relative_to_the_seeds():
    rows = {"name": ["seeds", "eigen", "eigen", "timing"], "valid_share": [None, 0.9, 1.0, 1.0]}
    rows |= {"valid": [1.0, None, None, None], "cosine": [0.0, 0.1, 0.3, 0.0]}
    rows |= {key: [2.0, 1.0, 3.0, 9.0] for key in ("condition", "distance", "rank_uncentred")}
    gains = ("gain", "gain_geometric", "gain_constant", "gain_constant_geometric")
    rows |= {key: [1.0, 4.0, 6.0, 9.0] for key in gains}
    table = beside_seeds(pd.DataFrame(rows), ["eigen"])
    assert list(table.index) == ["seeds", "eigen"] and (table.loc["seeds"].iloc[2:] == 1).all()
    eigen = table.loc["eigen"].to_dict()
    assert eigen["valid"] == pytest.approx(0.95) and eigen["mean cosine"] == pytest.approx(0.2)
    assert eigen["cond(YᵀY)"] == 1 and eigen["error, the paper's noise"] == pytest.approx(0.2)


OWN = """
from sidegan.gan.losses import Loss
from sidegan.gan.variants import Vanilla


class Slow(Vanilla):
    def losses(self):
        return [*super().losses(), Loss(1.0, lambda batch: batch.coefficients.square().mean())]
"""


def test_a_variant_of_ones_own_trains_in_an_experiment_and_in_python(made, tmp_path, monkeypatch):
    """A class in a package beside, and its file in a folder of settings: nothing is edited here."""
    (tmp_path / "mylab.py").write_text(OWN)
    (tmp_path / "lab" / "gan").mkdir(parents=True)
    own = "defaults: [_base@mine, _self_]\n\nmine:\n  _target_: mylab.Slow\n  weights: {adversarial: 1}\n"
    (tmp_path / "lab" / "gan" / "mine.yaml").write_text(own)
    words = ["--config-dir", "lab", "+experiment=exp1", *TINY, "gan=mine", "stages=[seeds,gan]"]
    ran = subprocess.run([sys.executable, "-m", "sidegan.run", *words], cwd=tmp_path, capture_output=True)
    assert ran.returncode == 0, ran.stderr
    assert [*tmp_path.glob("outputs/gan/planar2-mine-*/generator.pt")]
    monkeypatch.syspath_prepend(tmp_path)
    mine = {"_target_": "mylab.Slow", "weights": {"adversarial": 1}, "epochs": 1, "steps": 1}
    generator = sidegan.train(mine, made.cell, made.load(seed_set(made)).coefficients)
    assert generator.sample(3).shape == (3, *made.cell.trajectory.shape)
