"""Artifacts that are published beside the page: what a run of today takes for its own."""

import shutil
from pathlib import Path

import pytest
import torch

from sidegan.library.measure import measured, summary
from sidegan.pipeline.columns import columns
from sidegan.pipeline.settings import validate
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from tests.tiny import composed

PUBLISHED = Path(__file__).parents[2] / "docs" / "reproduction" / "artifacts"
_CHECKED = 60


@pytest.fixture(scope="module")
def task(tmp_path_factory):
    """The paper at its own scale under the paper's recipe, where what is published was copied to."""
    root = tmp_path_factory.mktemp("published") / "outputs"
    shutil.copytree(PUBLISHED, root)
    cfg = validate(composed("+experiment=reproduction", "scale=paper", "named=true", f"outputs={root}"))
    return columns(Task(cfg, Store(root, named=True)))["letter_first"].with_settings(half=None)


def test_the_papers_seeds_are_those_of_the_configuration(task):
    """Their stamp: a change of the recipe or of its maker's version makes them stale, and fails here."""
    assert task.store.find(seed_set(task)) is not None
    assert task.store.costs(seed_set(task))["cpu_seconds"] > task.cfg.seeds.count


def test_the_papers_seeds_are_valid_and_as_exciting_as_they_say(task):
    seeds = task.load(seed_set(task))
    assert len(seeds) == task.cfg.seeds.count == 1800
    some = torch.arange(0, len(seeds), len(seeds) // _CHECKED)
    again = measured(task.constraints, task.trajectory, seeds.coefficients[some], "paper")
    assert again.valid.all()
    torch.testing.assert_close(again.spectrum, seeds.spectrum[some], rtol=1e-6, atol=0)
    assert summary(seeds)["condition"] == pytest.approx(task.report(seed_set(task))["condition"], rel=1e-6)
