"""Artifacts that are published beside the page: what a run of today takes for its own."""

import shutil
from pathlib import Path

import pytest
import torch

from sidegan.library.measure import measured, summary
from sidegan.pipeline.columns import columns
from sidegan.pipeline.excerpt import listed
from sidegan.pipeline.settings import validate
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.store import STAMP, Store
from sidegan.pipeline.task import Task
from tests.tiny import composed

PUBLISHED = Path(__file__).parents[2] / "docs" / "reproduction" / "artifacts"
_CHECKED = 60


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """The paper at its own scale, where what is published was copied to."""
    root = tmp_path_factory.mktemp("published") / "outputs"
    shutil.copytree(PUBLISHED, root)
    cfg = validate(composed("+experiment=reproduction", "scale=paper", "named=true", f"outputs={root}"))
    return Task(cfg, Store(root, named=True))


@pytest.fixture(scope="module")
def task(whole):
    """The same under the paper's recipe."""
    return columns(whole)["letter_first"].with_settings(half=None)


def test_everything_published_is_what_todays_configuration_makes(whole):
    """By its stamp: a change of a recipe or of a maker's version makes it stale, and fails here."""
    store = whole.store
    asked_for = {store.folder(one): one for one in listed(whole)}
    there = [path.parent for path in store.root.rglob(STAMP)]
    assert [folder for folder in there if folder not in asked_for] == []
    assert [folder for folder in there if store.find(asked_for[folder]) is None] == []


def test_the_papers_seeds_are_those_of_the_configuration(task):
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
