import re
from dataclasses import replace
from types import SimpleNamespace

import pandas as pd
import pytest

from experiments import ablation
from experiments.pages import FOLDER
from sidegan.pipeline.compose import composed
from sidegan.pipeline.tracking import Tracker
from tests.tiny import tiny


@pytest.fixture
def found(monkeypatch):
    """Numbers of two rows of two variants, whose seeds have condition number 100 and ratio 10."""
    monkeypatch.setattr(ablation, "generator", lambda run, name, training: (run, name, training))

    def made(row, scale):
        base = {"valid_share": 0.9, "valid": 1.0, "diagonal_ratio": 20.0, "distance": 1.0, "cosine": 0.0}
        frame = [{"name": "seeds", "training": 0, **base, "condition": 100.0, "diagonal_ratio": 10.0}]
        frame += [
            {"name": name, "training": k, **base, "valid_share": 0.9 + 0.01 * k}
            | {"condition": scale * (100 + k), "condition_valid": 50.0}
            for name in ("vanilla", "eigen")
            for k in range(2)
        ]
        costs = {("run", "vanilla"): 10.0, ("run", "eigen"): 30.0}
        return SimpleNamespace(
            generators=pd.DataFrame(frame),
            cfg=SimpleNamespace(gan={"vanilla": None, "eigen": None}),
            run="run",
            costs=lambda one: {"cpu_seconds": costs[one[:2]]},
        )

    return ablation.numbers({"the recipe": made("run", 1.0), "fitness 0": made("run", 3.0)})


def test_a_row_is_relative_to_the_seeds_and_has_its_cost(found):
    first = found[(found["row"] == "the recipe") & (found.name == "eigen")]
    assert first.condition.tolist() == [1.0, 1.01] and first.condition_valid.tolist() == [0.5, 0.5]
    assert first.diagonal_ratio.tolist() == [2.0, 2.0] and first.cpu.tolist() == [30.0, 30.0]
    table = ablation.table(found)
    assert table.loc[("fitness 0", "vanilla"), "n"] == 2 and table.index[0] == ("controls", "seeds")
    assert table.loc[("the recipe", "vanilla"), "valid"].startswith("0.9")


def test_a_comparison_of_ones_own_has_a_page_with_its_name_and_seeds(found, monkeypatch, tmp_path):
    own = replace(tiny("condition=gradient", experiment="ablation"), experiment="mine")
    monkeypatch.setattr(ablation, "numbers", lambda rows: found.assign(coverage=0.5, coverage_diagonal=0.4))
    ablation.present({"row": SimpleNamespace(cfg=own)}, tmp_path, Tracker(tmp_path, "mine", "run", "off"))
    page = (tmp_path / "mine.md").read_text(encoding="utf-8")
    assert "+experiment=mine" in page and "mine/figures/front" in page
    assert "seeds by gradient descent" in page and "| the recipe | eigen | 2 |" in page


def test_a_row_can_be_made_shorter_as_the_page_says():
    text = (FOLDER / "templates" / "ablation.md.j2").read_text(encoding="utf-8")
    (word,) = re.findall("`'(rows[^`]*)'`", text)
    assert composed("+experiment=ablation", word).rows["the_recipe"] == ["gan=eigen", "trainings=[0]"]


def test_the_front_has_a_panel_for_validity_and_each_coverage(found):
    figure = ablation.front(found.assign(coverage=0.5, coverage_diagonal=0.4))
    labels = [axis.get_ylabel() for axis in figure.axes]
    assert labels == ["invalid share", "coverage of c", "coverage of log diag(YᵀY)"]
    assert {text.get_text() for text in figure.axes[0].texts} == {"recipe", "0"}
