import json

import numpy as np
import pandas as pd
import pytest

from experiments import exp2, training
from experiments.artifacts import Evidence
from experiments.claims import HOLDS, NOT, claims
from experiments.comparisons import ablation, costs, densities, kinds, sensitivity, subsets
from sidegan.errors import ArtifactError, ConfigError
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.plan import Task, with_subset
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import STAGES
from tests.tiny import tiny

SMALL = (
    "trainings=[0,1]",
    "discussion.sizes=[20]",
    "discussion.draws=30",
    "sensitivity.priors=[1]",
    "sensitivity.counts=[2]",
    "~sensitivity.noises.additive",
    "kinds.paper.steps=3",
    "kinds.paper.ants=10",
    "kinds.paper.evaluations=40",
    "gan@ablation=[eigen_cold]",
)


def config(root, *overrides):
    return tiny(*SMALL, f"outputs={root}", *overrides, experiment="reproduction")


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    """Root of a whole tiny reproduction."""
    folder = tmp_path_factory.mktemp("outputs")
    run_stages(config(folder, f"publish={folder}/docs"), folder / "runs" / "first", "first", STAGES)
    return folder


@pytest.fixture(scope="module")
def evidence(root):
    return Evidence(Task(config(root), Store(root)))


def test_the_report_is_a_page_a_document_tables_figures_and_metrics(root):
    docs = root / "docs"
    text, page = ((docs / f"reproduction.{end}").read_text(encoding="utf-8") for end in ("md", "html"))
    for title in (
        "Table I",
        "Tables II and III",
        "Figure 3",
        "Figure 2",
        "Timing",
        "Ablation",
        "Sensitivity",
    ):
        assert title in text and title in page
    assert "default-src 'none'" in page  # nothing is fetched
    for link in [part.partition(")")[0] for part in text.split("](")[1:]]:
        assert (docs / link).is_file(), link
    made = {path.name for path in (docs / "reproduction" / "tables").iterdir()}
    for name in ("table1", "table2", "table3", "generators", "timing", "ablation", "density", "sensitivity"):
        assert {f"{name}.csv", f"{name}.md"} <= made
    metrics = json.loads((docs / "reproduction" / "metrics.json").read_text())
    assert metrics["covariance.seeds ×1"] > metrics["covariance.seeds ×10"] > 0


def test_every_claim_of_the_paper_has_a_verdict_and_a_reason(evidence):
    made = claims(evidence)
    assert len({claim.text for claim in made}) == len(made) >= 15
    for claim in made:
        assert claim.paper and claim.ours and claim.why.endswith(".")
        assert "nan" not in claim.ours.lower()


def test_verdicts_follow_from_the_numbers(evidence, monkeypatch):
    def verdict(text):
        return next(claim.verdict for claim in claims(evidence) if text in claim.text)

    for share, expected in ((0.0, HOLDS), (0.5, NOT)):
        frame = evidence.density.assign(success=share)
        monkeypatch.setitem(evidence.__dict__, "density", frame)
        assert verdict("Kernel density") == expected
    raw = evidence.errors.copy()
    for factor, expected in ((10.0, HOLDS), (0.1, NOT)):
        frame = raw.assign(nmse=np.where(raw["set"].str.startswith("long"), factor, 1.0))
        monkeypatch.setitem(evidence.__dict__, "errors", frame)
        assert verdict("beat one long") == expected


def test_a_smaller_seed_set_is_a_part_of_the_whole(evidence):
    frame = subsets(evidence)
    sizes = frame.groupby(["seeds", "variant"]).size()
    assert sizes.to_dict() == {(20, n): 1 for n in ("eigen", "diagonal")} | {
        (40, n): 2 for n in ("vanilla", "eigen", "diagonal")
    }
    whole = with_subset(evidence.task, 40)
    assert whole.cfg.subset is None


def test_tables_for_people_show_every_row(evidence):
    assert list(ablation(evidence).index) == ["eigen", "eigen_cold"]
    assert len(densities(evidence)) == 5
    assert costs(evidence.costs).loc["one generated trajectory", "paper [s]"] == "0.0014"
    table, points = kinds(evidence)
    assert set(table.index) == set(points.kind) == {"gradient", "paper", "diagonal"}
    assert points.groupby("kind").size().nunique() == 1


def test_sensitivity_changes_one_setting_at_a_time(evidence):
    frame = evidence.sensitivity
    changes = frame.groupby(["factor", "value"]).size()
    assert ("none", "as in experiment 1") in changes.index and ("prior", "1") in changes.index
    table = sensitivity(frame, weighted=False)
    assert table["random valid"].str.contains("±|—").any() or len(table)
    assert (table.apply(lambda row: row.str.contains(r"\*\*").sum(), axis=1) == 1).all()
    usual = frame[(frame.factor == "none") & (frame["set"] == "seeds")]
    assert set(usual.samples) == {evidence.task.cfg.selection.count * 161}


def test_more_samples_of_the_same_seeds_shrink_the_covariance_in_proportion(evidence):
    norms = evidence.replication.facts.groupby("set").covariance_norm.mean()
    assert norms["seeds ×1"] / norms["seeds ×10"] == pytest.approx(10, rel=0.1)


def test_improvement_is_one_minus_the_ratio_of_errors():
    rows = [
        ("seeds ×1", 0, "a", 4.0),
        ("seeds ×1", 0, "b", 2.0),
        ("eigen", 0, "a", 1.0),
        ("eigen", 0, "b", 3.0),
    ]
    part = pd.DataFrame(rows, columns=["set", "repeat", "joint", "nmse"]).assign(training=0)
    gain = exp2.improvement(part, "eigen", "seeds ×1").set_index("joint").improvement
    assert gain.to_dict() == {"a": 75.0, "b": -50.0}


def test_table_2_and_3_show_the_papers_numbers_beside_ours(evidence):
    material = evidence.replication
    table = exp2.table2(material.results[~material.results.weighted], material.config)
    assert table.loc["seeds + eigen", "×1, paper"] == "51 ± 27" and "±" in table.loc["seeds + eigen", "×1"]
    third = exp2.table3(material.facts)
    assert list(third.index)[:3] == ["seeds ×1", "seeds ×4", "seeds ×10"]
    assert third.loc["seeds + eigen", "paper"] == "1.89143"


def test_epochs_to_reliability():
    def run(*shares):
        return [{"success": share} for share in shares]

    table = training.speed(
        {"eigen": [run(0.1, 0.85, 0.7), run(0.9, 0.2, 0.95)], "vanilla": [run(0.1), run(None)]}
    )
    assert (
        table.loc["eigen", "first epoch"] == "2, 1" and table.loc["vanilla", "first epoch"] == "never, never"
    )
    assert table.loc["eigen", "best"] == "0.9 ± 0.071"


def test_a_report_without_its_artifacts_names_what_is_missing(tmp_path):
    with pytest.raises(ArtifactError, match="run stage seeds first"):
        run_stages(config(tmp_path, "stages=[table]"), tmp_path / "run", "alone", STAGES)


@pytest.mark.parametrize(
    ("override", "message"),
    [
        ("discussion.sizes=[41]", "at most seeds.count = 40"),
        ("sensitivity.counts=[41]", "sensitivity.counts goes to 41"),
        ("replication.replicas=[]", "replicas is"),
        ("identification.forgetting=0.9", "forgetting must be 1"),
        ("trainings=[]", "trainings is"),
        ("subset=41", "subset is 41"),
        ("seeds.count=0", "seeds.count is 0"),
        ("selection.count=1000", "selection.count is 1000"),
        ("scale.gan_epochs=1", "fitness_start"),
    ],
)
def test_impossible_combinations_are_refused_before_any_work(override, message, tmp_path):
    with pytest.raises(ConfigError, match=message):
        config(tmp_path, override)


def test_a_density_estimate_of_too_few_seeds_is_refused(root):
    few = config(root, "stages=[density]", "subset=10")
    with pytest.raises(ConfigError, match="more seeds than coefficients: 10 and 12"):
        run_stages(few, root / "runs" / "few", "few", STAGES)
