import pandas as pd
import pytest

from experiments import ladder as page
from sidegan.base.storage import read_json
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import ladder
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from tests.tiny import tiny


@pytest.fixture(scope="module")
def climbed(outputs, tmp_path_factory):
    """The task of a ladder of three rungs that was run, and the run's folder."""
    folder = tmp_path_factory.mktemp("ladder")
    config = tiny(f"outputs={outputs}", experiment="ladder")
    run_stages(config, folder, "ladder")
    return Task(config, Store(outputs)), folder


def test_the_table_has_a_row_for_the_seeds_and_for_each_rung(climbed):
    task, folder = climbed
    table = pd.read_csv(folder / "ladder" / "tables" / "ladder.csv", index_col=0)
    assert list(table.index) == ["seeds", "letter", "non_saturating", "ours", "repaired"]
    assert list(table.columns) == [
        "changed",
        "valid share",
        "median cond(YᵀY) of the valid",
        "mean distance",
        "effective rank",
    ]
    (ours,) = ladder.rungs(task)["ours"]
    assert float(table["effective rank"]["ours"]) == pytest.approx(task.history(ours)[-1]["rank"], rel=0.01)
    text = (folder / "ladder.md").read_text(encoding="utf-8")
    assert "the same 40 seeds" in text and "| non_saturating |" in text
    shown = read_json(folder / "ladder" / "metrics" / "ours.json")
    assert shown["rank"] == pytest.approx(page.rows(task).set_index("rung")["rank"]["ours"], rel=1e-3)


def test_the_repair_without_each_part_stands_beside_it(climbed):
    task, folder = climbed
    table = pd.read_csv(folder / "ladder" / "tables" / "repair.csv", index_col=0)
    assert list(table.index) == ["repaired", "repaired_undiverse"]
    (less,) = ladder.rungs(task)["repaired_undiverse"]
    assert float(table["effective rank"]["repaired_undiverse"]) == pytest.approx(
        task.report(less)["rank"], rel=0.01
    )


def test_ours_without_each_part_stands_beside_ours(climbed):
    task, folder = climbed
    table = pd.read_csv(folder / "ladder" / "tables" / "parts.csv", index_col=0)
    assert list(table.index) == ["ours", "eigen_cold"]
    text = (folder / "ladder.md").read_text(encoding="utf-8")
    assert "| eigen_cold |" in text
    (cold,) = ladder.parts(task)["eigen_cold"]
    assert float(table["effective rank"]["eigen_cold"]) == pytest.approx(task.report(cold)["rank"], rel=0.01)


def test_beside_each_rung_stands_what_it_changes():
    config = tiny(experiment="ladder")
    changes, of_ours = page.changes(config), page.changes_of_ours(config)
    assert list(changes) == ["non_saturating", "ours", "repaired", "repaired_undiverse"]
    assert changes["repaired_undiverse"] == "weights.distance 0, weights.rank 0"
    assert changes["non_saturating"] == "losses.adversarial non_saturating"
    assert "body mlp" in changes["repaired"] and "losses.adversarial" not in changes["repaired"]
    assert of_ours == {"eigen_cold": "gaussian_start no"}


def test_rungs_share_the_surrogates_of_their_kind(climbed):
    task, _ = climbed
    made = {name: artifacts[0].inputs for name, artifacts in ladder.rungs(task).items()}
    assert made["letter"]["predictor"].digest == made["non_saturating"]["predictor"].digest
    assert made["letter"]["predictor"].digest == made["letter"]["converter"].digest
    assert made["letter"]["predictor"].digest != made["ours"]["predictor"].digest


def test_the_largest_steps_are_named_on_the_way_to_ours_alone():
    columns = ["rung", "success", "rank", "condition_valid"]
    rows = [
        ("seeds", 1.0, 60.0, 90.0),
        ("letter", 0.0, 5.0, None),
        ("wild", 0.1, 55.0, 9000.0),
        ("limited", 0.6, 20.0, 1000.0),
        ("limited", 0.8, 22.0, 1200.0),
        ("diversity", 0.65, 50.0, 1500.0),
        ("ours", 0.95, 55.0, 500.0),
        ("repaired", 1.0, 90.0, 10.0),
    ]
    steps = page.largest_steps(pd.DataFrame(rows, columns=columns))
    assert {name: step.rung for name, step in steps.items()} == {
        "success": "limited",
        "rank": "diversity",
        "condition_valid": "ours",
    }
    assert steps["success"] == ("limited", 0.1, pytest.approx(0.7)) and steps["rank"].before == 21
    none = pd.DataFrame([("seeds", 1.0, 60.0, 90.0), ("letter", 0.0, 5.0, None)], columns=columns)
    assert page.largest_steps(none) == {}
