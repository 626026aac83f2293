"""The page on the paper: made from what a run left, with verdicts that follow from the numbers."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from jinja2 import Template

from experiments import reproduction
from experiments.artifacts import Artifacts
from experiments.claims import claims, confirmed
from experiments.pages import DOCS, FOLDER, PAPER
from experiments.verdicts import HOLDS, NOT, OPEN, UNDECIDED, UNKNOWN, Judgement
from sidegan.errors import ConfigError
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import stage
from sidegan.pipeline.stages.selection import library
from sidegan.pipeline.stages.training import generator, load_generator, surrogate_networks
from sidegan.pipeline.store import Store
from tests.refusals import refused
from tests.tiny import tiny


def judged(run, **changed):
    """What was found of every claim, by its key, where some frames are others."""
    planted = type("Planted", (Artifacts,), changed)(run)
    return {claim.key: claim.findings["ours"] for claim in claims({"ours": planted})}


def test_the_page_has_the_tables_and_figures_that_it_links_to(page, artifacts):
    text = (page / "reproduction.md").read_text(encoding="utf-8")
    links = [part.partition(")")[0] for part in text.split("](")[1:]]
    links = [link.partition("#")[0] for link in links]
    assert any(link.endswith("docs/decisions.md") for link in links)  # the page is published elsewhere
    assert all((page / link).is_file() for link in links)
    assert "dvc repro" not in text and "over noise draws, or plants, and trainings" in text
    joined = {"claims", "findings", "seeds", "factors", "generators", "table1", "table2", "table3", "density"}
    own = {f"ours-{name}" for name in ("timing", "sets", "long", "epochs", "whole")}
    assert joined | own <= {path.stem for path in page.rglob("*.csv")}
    readings = pd.read_csv(page / "reproduction" / "tables" / "readings.csv", index_col=0)
    assert readings.loc["paper", "noise on"] == "Paper" and readings.loc["ours", "eigen"].size == 4
    files = (page / "reproduction" / "metrics" / f"ours-{name}.json" for name in ("seeds", "eigen"))
    seeds, eigen = (json.loads(file.read_text("utf-8")) for file in files)
    assert seeds["valid"] == 1 and seeds["‖diag P‖ [1e-9]"] > eigen["‖diag P‖ [1e-9]"] > 0
    norms = artifacts.whole_facts.groupby("set").covariance_norm.mean()
    assert seeds["‖diag P‖ [1e-9]"] == pytest.approx(1e9 * norms["seeds ×1"], rel=1e-3)
    assert norms["seeds ×1"] / norms["seeds ×10"] == pytest.approx(10, rel=0.1)  # as many samples more


@pytest.mark.parametrize("sensor", ["link", "motor"])
def test_the_page_says_where_its_plants_sense_torque(sensor):
    cfg = tiny(f"plants={sensor}", experiment="reproduction")
    template = (FOLDER / "templates" / "reproduction.md.j2").read_text(encoding="utf-8")
    lines = [Template(line).render(cfg=cfg, docs=DOCS) for line in template.splitlines() if "sense" in line]
    assert len(lines) == 2
    for line in lines:
        assert f"at the {sensor}" in line and ("link" in line) == (sensor == "link")


def test_a_run_lists_its_artifacts_those_on_fewer_seeds_apart(page, outputs):
    made = json.loads((page.parent / "artifacts.json").read_text(encoding="utf-8"))
    assert {"seeds", "surrogates", "gan/eigen-0", "gan/eigen-of20", "library/eigen-1"} <= made.keys()
    assert "planar2-eigen-seed0-training0-of20-" in made["gan/eigen-of20"] and len(set(made.values())) == len(
        made
    )
    assert all((outputs / folder / "params.json").is_file() for folder in made.values())


def test_mlflow_loads_a_generator_without_its_arm(artifacts):
    import mlflow

    made = generator(artifacts.run, "eigen", artifacts.cfg.trainings[0])
    served = mlflow.pyfunc.load_model(str(artifacts.run.store.require(made)))
    own = load_generator(artifacts.run, made)
    for wanted in ({"count": 5, "seed": 3}, pd.DataFrame({"count": [5], "seed": [3]})):
        assert np.array_equal(served.predict(wanted), own.sample(5, 3))


def test_nothing_is_said_of_fewer_seeds_that_nothing_was_trained_on(page, outputs):
    config = tiny(f"outputs={outputs}", "discussion.sizes=[]", experiment="reproduction")
    whole = reproduction.collect(RunContext(config, Store(outputs)))
    found = {claim.key: claim for claim in claims(whole) if claim.key.startswith("few_seeds")}
    assert len(found) == 3 and {claim.findings["ours"].verdict for claim in found.values()} == {UNKNOWN}
    assert all("240 seeds" in claim.text for claim in found.values())


@pytest.mark.parametrize("subset", [None, 30])
def test_the_numbers_of_seeds_are_those_that_variants_learned_from(tmp_path, monkeypatch, subset):
    def histories(_, run):
        return pd.DataFrame({"learned": [run.cfg.subset or run.cfg.seeds.count]})

    monkeypatch.setattr(Artifacts, "_histories", histories)
    config = tiny(f"subset={subset or 'null'}", experiment="reproduction")
    found = Artifacts(RunContext(config, Store(tmp_path))).subsets
    assert found.seeds.tolist() == found.learned.tolist() == [20, subset or 40]


def test_only_a_variant_with_surrogates_pays_for_them(artifacts):
    run, first = artifacts.run, artifacts.cfg.trainings[0]
    surrogates = artifacts.costs(surrogate_networks(run))["cpu_seconds"]
    for name, paid in (("vanilla", 0.0), ("eigen", surrogates)):
        parts = generator(run, name, first), library(run, name, first)
        own = sum(artifacts.costs(part)["cpu_seconds"] for part in parts)
        assert artifacts.training_seconds(name, first) == pytest.approx(own + paid)


def test_every_number_that_a_run_records_is_explained(artifacts):
    text = (DOCS / "usage.md").read_text(encoding="utf-8").partition("### Names of numbers")[2]
    explained = set(re.findall(r"`(\w+)`", text.partition("\n## ")[0]))
    run, names = artifacts.run, set()
    for made in (made for name in run.cfg.stages for made in stage(name).artifacts(run)):
        costs = {key for key, x in run.store.costs(made).items() if isinstance(x, int | float)}
        names |= costs | made.metrics(run.store.require(made)).keys()
    others = {name.rpartition("/")[2] for name in names} - explained
    assert len(names) > 50 and {re.sub("^union_|_diagonal$|_geometric$", "", x) for x in others} <= explained


@pytest.fixture(scope="module")
def usual(artifacts):
    """Every claim as the run has it."""
    return claims({"ours": artifacts})


def test_what_a_tiny_run_of_another_arm_has_no_numbers_of_is_not_measured(usual):
    """Other arms, and epochs that its trainings do not reach."""
    unknown = {claim.key for claim in usual if claim.findings["ours"].verdict == UNKNOWN}
    assert unknown >= {"other_arms", "no_transfer", "reliable", "fitter", "traded", "more_diverse"}
    assert len(unknown) < len(usual) / 2


def test_a_predictor_without_faulty_samples_is_not_judged_by_them(artifacts):
    told = artifacts.surrogates | {"rejected": None}
    assert judged(artifacts.run, surrogates=told)["predictor"].verdict == UNKNOWN


@pytest.mark.parametrize(("directions", "verdict"), [(60.0, HOLDS), (6.0, NOT)])
def test_few_motions_that_cover_all_seeds_are_a_collapse(artifacts, directions, verdict):
    histories = artifacts.histories
    ranks = directions + 0.1 * histories.training
    late = histories.assign(epoch=histories.epoch + 39, rank_uncentred=ranks)
    covering = artifacts.generators.assign(coverage=1.0 + 0.01 * artifacts.generators.training)
    seeds = artifacts.as_many_seeds | {"rank_uncentred": 70.0}
    found = judged(artifacts.run, histories=late, generators=covering, as_many_seeds=seeds)
    assert found["no_collapse"].verdict == verdict


def test_every_claim_of_the_paper_has_a_verdict_and_a_reason(usual):
    assert [claim.key for claim in usual] == list(PAPER["claims"]) and len(usual) >= 25
    assert len({claim.text for claim in usual}) == len(usual)
    for claim in usual:
        assert "{" not in claim.text + claim.why + claim.criterion and claim.where and claim.paper
        assert claim.findings["ours"].ours and claim.why.endswith(".")


def test_another_condition_confirms_what_is_decided_alike_and_contradicts_what_is_decided_otherwise(usual):
    pairs = [(HOLDS, HOLDS), (HOLDS, OPEN), (HOLDS, NOT), (NOT, NOT), (UNDECIDED, HOLDS), (UNKNOWN, NOT)]
    found = [{"ours": Judgement(x, ""), "again": Judgement(y, "")} for x, y in pairs]
    told = confirmed([claim._replace(findings=each) for claim, each in zip(usual, found)], "ours", "again")
    assert "again confirms 1 of the 3 that hold and 1 of the 1 that do not hold;" in told
    assert told.endswith(f"it contradicts: {usual[2].text}")


@pytest.mark.parametrize(
    "factor, beaten, share, draws, failed",
    [(10.0, HOLDS, 0.0, 10_000, HOLDS), (0.1, NOT, 0.0, 30, OPEN), (1.0, UNDECIDED, 0.5, 30, NOT)],
)
def test_verdicts_follow_from_the_numbers(artifacts, factor, beaten, share, draws, failed):
    """Of errors; of a share and how many were drawn; of vanilla by its best epoch, which is told."""
    errors, histories = artifacts.errors, artifacts.histories
    noise = np.random.default_rng(0).uniform(0.9, 1.1, len(errors))
    nmse = noise * np.where(errors["set"].str.startswith("long"), factor, 1.0)
    best = (histories.variant == "vanilla") * np.where(histories.epoch == 1, 0.9, 0.0)
    success = histories.success.where(histories.variant != "vanilla", best)
    fewer = replace(artifacts.cfg.discussion, draws=draws)
    found = judged(
        artifacts.run.with_settings(discussion=fewer),
        density=artifacts.density.assign(success=share),
        errors=errors.assign(nmse=nmse),
        histories=histories.assign(success=success),
    )
    assert found["short_beat_long"].verdict == beaten
    assert found["density_fails"].verdict == failed
    assert found["vanilla_fails"].verdict == NOT and "after epoch 1" in found["vanilla_fails"].ours


def test_a_density_estimate_of_too_few_seeds_is_refused(page, outputs, tmp_path):
    few = tiny(f"outputs={outputs}", "stages=[density]", "subset=10", experiment="reproduction")
    with refused(ConfigError, "10", "12"):
        run_stages(few, tmp_path, "few")
