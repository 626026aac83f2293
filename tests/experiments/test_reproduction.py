import json
import shutil

import numpy as np
import pandas as pd
import pytest
import torch

from experiments import comparisons, exp2, reproduction, training
from experiments.artifacts import Group
from experiments.claims import claims, counted
from experiments.verdicts import HOLDS, NOT, OPEN, PART, UNDECIDED
from experiments.words import PAPER
from sidegan.errors import ArtifactError, ConfigError, SideganError
from sidegan.pipeline import excerpt as pipeline_excerpt
from sidegan.pipeline.excerpt import excerpt
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import stage
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.subsets import on_subset
from sidegan.pipeline.store import Store, left_out
from sidegan.pipeline.task import Task
from tests.tiny import tiny

PAGE = "reproduction"


@pytest.fixture(scope="module")
def groups(outputs, run):
    """What was made for every group of columns."""
    return reproduction.collect(Task(config(outputs), Store(outputs)))


@pytest.fixture(scope="module")
def artifacts(groups):
    """What was made under our own settings."""
    return groups["ours"].first


def config(root, *overrides):
    return tiny(f"outputs={root}", *overrides, experiment=PAGE)


def test_the_report_is_a_page_a_document_tables_figures_and_metrics(run, page, groups):
    docs, (text, tables) = run / "docs", page
    assert "**ours** (1 seed set of " in text
    assert "Not on this page, though `dvc repro` makes it: " in text and "ours (ours_second)" in text
    web = (docs / "reproduction.html").read_text(encoding="utf-8")
    for title in (
        "Table I",
        "Tables II and III",
        "Figure 3",
        "Figure 2",
        "Timing",
        "Sensitivity",
    ):
        assert f"## {title}" in text and title in web
    assert "default-src 'none'" in web  # nothing is fetched
    assert web.count('<img src="data:image/png;base64,') == 3 + 3 * len(groups)
    assert all(f'id="{name}"' in web for name in ("traces", "stacked", "snapshots"))  # to turn and to play
    names = {"table1", "table2", "table3", "generators", "timing", "density", "sensitivity"}
    names |= {"readings", "reading_verdicts", "recursions", "elsewhere", "elsewhere_weighted"}
    assert names <= tables
    assert not list(docs.glob("*/figures/*.svg"))
    seeds, eigen = (
        json.loads((docs / "reproduction" / "metrics" / f"ours-{name}.json").read_text())
        for name in ("seeds", "eigen")
    )
    assert seeds["valid"] == 1 and seeds["‖diag P‖ [1e-9]"] > eigen["‖diag P‖ [1e-9]"] > 0


def test_every_claim_of_the_paper_has_a_verdict_and_a_reason_in_every_group(groups):
    judged = claims(groups)
    assert [claim.key for claim in judged] == list(PAPER["claims"]) and len(judged) >= 25
    assert len({claim.text for claim in judged}) == len(judged)
    for claim in judged:
        assert "{" not in claim.text + claim.why + claim.criterion and claim.where
        assert claim.paper and claim.why.endswith(".")
        assert list(claim.findings) == list(groups)
        for finding in claim.findings.values():
            assert finding.ours


def test_a_column_has_its_own_seeds_and_constraints(groups):
    letter = groups["letter"].first
    seeds, whole = seed_set(letter.task), seed_set(letter.task.with_settings(half=None))
    assert 2 * len(letter.task.load(seeds)) == len(letter.task.load(whole)) == letter.cfg.seeds.count
    assert letter.cfg.seeds.method == "paper" and not letter.cfg.workspace.torque
    assert letter.seed_seconds > 0
    assert groups["ours"].first.cfg.workspace.torque


def test_columns_that_differ_in_their_seeds_are_one_group(tmp_path):
    second = "{title: ours, group: ours, seed: 1}"
    cfg = tiny(f"outputs={tmp_path}", f"+columns.ours_second={second}", experiment=PAGE)
    both = reproduction.collect(Task(cfg, Store(tmp_path)))["ours"].parts
    assert [part.cfg.seed for part in both.values()] == [0, 1]
    made = [seed_set(part.task) for part in both.values()]
    assert made[0].digest != made[1].digest


def test_verdicts_are_counted_in_words():
    assert counted([NOT, HOLDS, PART, HOLDS]) == "2 hold, 1 holds in part, 1 does not hold"
    assert counted([NOT, NOT, UNDECIDED]) == "1 no detectable difference, 2 do not hold"


def test_verdicts_follow_from_the_numbers(groups, artifacts, monkeypatch):
    def verdict(key):
        ours = {"ours": Group("ours", "ours", {"ours": artifacts})}
        (found,) = (claim.findings["ours"].verdict for claim in claims(ours) if claim.key == key)
        return found

    for share, expected in ((0.0, HOLDS), (0.5, NOT)):
        draws = artifacts.task.cfg.discussion.draws
        monkeypatch.setitem(artifacts.__dict__, "density", artifacts.density.assign(success=share))
        assert verdict("density_fails") == (expected if draws > 5000 or share else OPEN)
    raw = artifacts.errors.copy()
    noise = np.random.default_rng(0).uniform(0.9, 1.1, len(raw))
    for factor, expected in ((10.0, HOLDS), (0.1, NOT), (1.0, UNDECIDED)):
        frame = raw.assign(nmse=noise * np.where(raw["set"].str.startswith("long"), factor, 1.0))
        monkeypatch.setitem(artifacts.__dict__, "errors", frame)
        assert verdict("short_beat_long") == expected


def test_what_made_nothing_valid_adds_nothing_to_the_seeds(groups, artifacts, monkeypatch):
    def barren(*names):
        empty = artifacts.generators["name"].isin(names)
        frame = artifacts.generators
        frame = frame.assign(count=frame["count"].where(~empty, 0), drawn=frame.drawn.where(~empty, 500))
        monkeypatch.setitem(artifacts.__dict__, "generators", frame)
        ours = {"ours": Group("ours", "ours", {"ours": artifacts})}
        return {claim.key: claim.findings["ours"] for claim in claims(ours)}

    usual = barren()
    one, all_three = barren("vanilla"), barren("vanilla", "eigen", "diagonal")
    assert one["generated_improve"].verdict == usual["generated_improve"].verdict
    assert "no valid draw of vanilla (of 1,000): " in one["generated_improve"].ours
    for key in ("generated_improve", "smallest_norm", "real_generated_beat_seeds"):
        assert all_three[key].verdict == NOT and "nothing is added to the seeds" in all_three[key].ours
    assert all_three["short_beat_long"] == usual["short_beat_long"]
    assert all_three["faster"].verdict == usual["faster"].verdict
    assert (
        all_three["faster"].ours == f"{usual['faster'].ours}; no sample of the SIDE-GANs' is valid at the end"
    )


def test_vanilla_is_judged_by_its_best_epoch_which_is_told(artifacts, monkeypatch):
    histories = artifacts.histories
    vanilla = histories.variant == "vanilla"
    success = np.where(vanilla & (histories.epoch == 1), 0.9, np.where(vanilla, 0.0, histories.success))
    monkeypatch.setitem(artifacts.__dict__, "histories", histories.assign(success=success))
    group = Group("ours", "ours", {"ours": artifacts})
    (found,) = (x.findings["ours"] for x in claims({"ours": group}) if x.key == "vanilla_fails")
    assert found.verdict == NOT
    assert "valid (after epoch 1), at the end vanilla " in found.ours


def test_a_smaller_seed_set_is_a_part_of_the_whole(artifacts):
    frame = artifacts.subsets
    frame = frame[frame.kept]
    sizes = frame.groupby(["seeds", "variant"]).size()
    assert sizes.to_dict() == {(20, n): 1 for n in ("eigen", "diagonal")} | {
        (40, n): 2 for n in ("vanilla", "eigen", "diagonal")
    }
    whole = on_subset(artifacts.task, 40)
    assert whole.cfg.subset is None


def test_tables_for_people_show_every_row(artifacts):
    assert len(comparisons.densities(artifacts.density)) == 5
    costs = comparisons.costs(comparisons.durations(artifacts, 4.0))
    assert costs.loc["one seed by gaco + compass search, CPU", "ours [s]"] == "4"
    assert "colony" not in comparisons.durations(artifacts).index
    assert costs.loc["one generated trajectory", "paper [s]"] == "0.0014"
    assert costs.loc["the surrogates, wall", "paper [s]"] == "—"
    table, points = comparisons.kinds(artifacts.kinds), comparisons.kind_points(artifacts.kinds)
    assert set(table.index) == set(points.kind) == {"gradient", "gradient, diagonal"}
    assert points.groupby("kind").size().nunique() == 1


def test_kinds_of_seeds_are_of_the_optimiser_of_their_column(groups):
    kinds = reproduction.kinds_of(groups)
    assert list(kinds) == [
        *("gradient", "gradient, diagonal"),
        *("gaco, compass search", "gaco, compass search, diagonal"),
    ]
    sources = [set(library.source) for _, library in kinds.values()]
    assert sources == [{"gradient"}] * 2 + [{"paper"}] * 2
    counts = [len(library) for _, library in kinds.values()]
    assert counts == [40, 10, 40, 10]  # the paper's eigenvalue seeds before they are halved
    assert not torch.equal(*(kinds[name][1].coefficients[:10] for name in list(kinds)[2:]))


def test_sensitivity_changes_one_setting_at_a_time(artifacts):
    frame = artifacts.sensitivity
    changes = frame.groupby(["factor", "value"]).size()
    assert ("none", "as in experiment 1") in changes.index and ("prior", "1") in changes.index
    table = comparisons.sensitivity(frame, weighted=False)
    assert len(table) == changes[~changes.index.duplicated()].size
    assert table["random valid"].str.fullmatch(r"—|[\d.e-]+( ± [\d.e-]+)?").all()
    assert not table.apply(lambda row: row.str.contains(r"\*\*")).any(axis=None)  # a few draws name no winner
    usual = frame[(frame.factor == "none") & (frame["set"] == "seeds")]
    assert set(usual.samples) == {artifacts.task.cfg.selection.count * 161}


def test_more_samples_of_the_same_seeds_shrink_the_covariance_in_proportion(artifacts):
    norms = artifacts.whole_facts.groupby("set").covariance_norm.mean()
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


def test_table_2_and_3_show_the_papers_numbers_beside_ours(artifacts):
    results = artifacts.whole_errors
    table = exp2.table2(results[~results.weighted], artifacts.cfg)
    assert table.loc["seeds + eigen", "×1, paper"] == "51 ± 27" and "±" in table.loc["seeds + eigen", "×1"]
    third = exp2.table3(artifacts.whole_facts)
    assert list(third.index)[:3] == ["seeds ×1", "seeds ×4", "seeds ×10"]
    assert third.loc["seeds + eigen", "paper"] == "1.89143"
    told = third.loc[["seeds ×1", "seeds ×10"], "‖diag P‖ × samples"].astype(float)
    assert told.iloc[0] == pytest.approx(told.iloc[1], rel=0.1)  # more samples of the same trajectories


def test_what_nobody_changed_is_the_same_in_every_reading(artifacts):
    errors, facts = artifacts.readings, artifacts.whole_facts
    assert set(errors.reading) == {"everything", "replications", "torques"}
    table = errors.set_index(["set", "training", "repeat", "weighted", "joint"]).sort_index()
    own, seeds_alone = (table[table.reading == x].nmse for x in ("everything", "replications"))
    pd.testing.assert_series_equal(own, artifacts.whole_errors.set_index(table.index.names).nmse.sort_index())
    seeds = [name for name in facts["set"].unique() if name.startswith("seeds")]
    pd.testing.assert_series_equal(own.loc[seeds], seeds_alone.loc[seeds])
    assert (own.loc["eigen"] != seeds_alone.loc["eigen"]).all()


def test_a_recursion_that_forgets_nothing_has_the_norms_of_table_3(artifacts):
    norms = artifacts.covariances
    usual = norms[(norms.prior == artifacts.cfg.identification.prior) & (norms.forgetting == 1)]
    facts = artifacts.whole_facts[artifacts.whole_facts.repeat == 0]
    both = usual.merge(facts, on=["set", "training"])
    assert len(both) == len(facts) == len(usual)
    assert both.covariance_norm_x.to_numpy() == pytest.approx(both.covariance_norm_y.to_numpy(), rel=1e-6)


def test_epochs_to_reliability():
    shares = {
        ("eigen", 0): (0.1, 0.85, 0.7),
        ("eigen", 1): (0.9, 0.2, 0.95),
        ("diagonal", 0): (0.9, 0.9, 0.9),
        ("diagonal", 1): (0.8, 0.1, 0.9),
        ("vanilla", 0): (0.1, None, 0.1),
    }
    rows = [
        {"variant": name, "training": k, "epoch": epoch, "success": share}
        for (name, k), run in shares.items()
        for epoch, share in enumerate(run, 1)
    ]
    table = training.speed(pd.DataFrame(rows))
    assert table.loc["eigen", "first epoch"] == "2, 1" and table.loc["vanilla", "first epoch"] == "never"
    assert table.loc["diagonal", "first epoch"] == "1 (2 ×)"
    assert table.loc["eigen", "best"] == "0.9 ± 0.071"


def test_a_report_without_its_artifacts_names_what_is_missing(tmp_path):
    with pytest.raises(ArtifactError, match="run stage surrogates first"):
        run_stages(config(tmp_path, "stages=[table]"), tmp_path / "run", "alone")


def test_a_column_alone_makes_nothing_of_ours_but_what_it_is_made_from(outputs):
    other, ours, every = (
        {
            name: stage(name).listed(Task(config(outputs, *only), Store(outputs)))
            for name in ("gan", "sensitivity")
        }
        for only in (["only=[letter_first]"], ["only=[ours]"], [])
    )
    assert other["sensitivity"] == [] and len(ours["sensitivity"]) == len(every["sensitivity"]) == 1
    assert {one.shelf for one in other["gan"]} == {"columns/letter_first/gan"}
    assert len(other["gan"]) + len(ours["gan"]) < len(every["gan"])


class TestExcerpt:
    """What the page is made from, without the rest."""

    @pytest.fixture(scope="class")
    @staticmethod
    def copied(outputs, run, tmp_path_factory):
        """The excerpt's folder, and how many artifacts are there and not."""
        folder = tmp_path_factory.mktemp("excerpt") / "results"
        task = Task(config(outputs), Store(outputs))
        return folder, excerpt(task, folder)

    def test_has_no_networks_but_those_that_are_drawn_and_timed(self, copied):
        folder, (there, missing) = copied
        assert there > 50 and missing == 0
        networks = {path.relative_to(folder).as_posix() for path in folder.rglob("*.pt")}
        assert networks == {"gan/planar2-eigen-seed0-training0/generator.pt"}
        libraries = [path.parent.name for path in (folder / "library").rglob("library.parquet")]
        assert libraries == ["planar2-eigen-seed0-training0"]
        assert left_out(folder / "gan" / "planar2-eigen-seed0-training1") == ["generator.pt"]
        assert list((folder / "costs").rglob("*.json"))

    def test_gives_the_same_page(self, copied, run, tmp_path):
        folder, _ = copied
        outputs = tmp_path / "outputs"
        shutil.copytree(folder, outputs)
        again = config(outputs, "named=true", "stages=[table]")
        run_stages(again, tmp_path / "run", "again")
        for name in ("claims", "table1", "table3", "generators", "letter-table2"):
            one, other = (x / PAGE / "tables" / f"{name}.csv" for x in (tmp_path / "run", run / "docs"))
            assert one.read_text(encoding="utf-8") == other.read_text(encoding="utf-8"), name

    def test_what_needs_more_is_refused_with_what_to_remove(self, copied, tmp_path):
        folder, _ = copied
        outputs = tmp_path / "outputs"
        shutil.copytree(folder, outputs)
        shutil.rmtree(outputs / "selection" / "planar2-eigen-seed0-training1")
        message = r"library/planar2-eigen-seed0-training1, which is an excerpt without library\.parquet"
        with pytest.raises(ArtifactError, match=message):
            run_stages(config(outputs, "named=true", "stages=[selection]"), tmp_path / "run", "more")

    def test_what_something_missing_needs_stays_behind_altogether(self, copied, tmp_path):
        folder, (there, _) = copied
        outputs = tmp_path / "outputs"
        shutil.copytree(folder, outputs)
        shutil.rmtree(outputs / "selection" / "planar2-eigen-seed0-training1")
        task = Task(config(outputs, "named=true"), Store(outputs, named=True))
        kept, missing = excerpt(task, tmp_path / "less")
        assert kept + missing == there and missing >= 4
        assert not (tmp_path / "less" / "library" / "planar2-eigen-seed0-training1").exists()
        assert not (tmp_path / "less" / "gan" / "planar2-eigen-seed0-training1").exists()
        assert (tmp_path / "less" / "gan" / "planar2-eigen-seed0-training0").exists()

    def test_the_command_says_how_much_there_is_and_what_it_took(
        self, outputs, run, tmp_path, monkeypatch, capsys
    ):
        monkeypatch.setattr(pipeline_excerpt, "task", lambda name, root: Task(config(root), Store(root)))
        monkeypatch.setattr("sys.argv", ["excerpt", str(outputs), str(tmp_path / "there")])
        assert pipeline_excerpt.main() == 0
        costs = [json.loads(x.read_text()) for x in (tmp_path / "there" / "costs").rglob("*.json")]
        hours = sum(one["cpu_seconds"] for one in costs) / 3600
        assert f"made in {hours:.1f} hours of one core; 0 are not made" in capsys.readouterr().out

    def test_of_nothing_is_refused(self, tmp_path):
        root = tmp_path / "outputs"
        with pytest.raises(SideganError, match="holds nothing of the experiment 'reproduction'"):
            excerpt(Task(config(root), Store(root)), tmp_path / "none")


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


def test_a_density_estimate_of_too_few_seeds_is_refused(run, outputs, tmp_path):
    few = config(outputs, "stages=[density]", "subset=10")
    with pytest.raises(ConfigError, match="more seeds than coefficients: 10 and 12"):
        run_stages(few, tmp_path, "few")
