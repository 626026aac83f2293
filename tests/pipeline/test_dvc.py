"""The pipeline at paper scale: it cannot be run here, but it must be the one that the graph describes."""

import shlex
from dataclasses import replace
from pathlib import Path

import pytest
import yaml

from sidegan.pipeline import dvc
from sidegan.pipeline.settings import validate
from sidegan.pipeline.stages import STAGES
from sidegan.pipeline.task import Task
from tests.tiny import composed

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "dvc.yaml").read_text(encoding="utf-8")
LADDERS = (ROOT / dvc.LADDERS).read_text(encoding="utf-8")
APART = yaml.safe_load(LADDERS)["stages"]
PIPELINE = yaml.safe_load(TEXT)["stages"] | APART


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """Every stage and its artifacts."""
    return dvc.parts(tmp_path_factory.mktemp("outputs"))


def paths(stage, key):
    return [next(iter(entry)) if isinstance(entry, dict) else entry for entry in stage.get(key, [])]


def test_the_file_is_current(made):
    written = {"dvc.yaml": TEXT, dvc.LADDERS: LADDERS}
    assert dvc.files(made) == written, "run python -m sidegan.pipeline.dvc"
    assert len(TEXT.splitlines()) <= 250


def test_the_page_needs_no_ladder():
    assert list(APART) == ["ladder", "quality", "worth"] and all(
        one["wdir"] == ".." for one in APART.values()
    )
    made = {path for one in APART.values() for path in paths(one, "outs")}
    others = [one for name, one in PIPELINE.items() if name not in APART]
    assert not made & {path for one in others for key in ("deps", "outs") for path in paths(one, key)}


def test_quality_shares_the_generators_that_the_page_has(made):
    shared = {"seeds", "surrogates", "gan", "library", "ours_on_paper"}
    page = {one.digest for name in shared for one in made[name]}
    used = {parent.digest for one in made["quality"] if one.maker == "added" for parent in one.parents}
    assert len(used & page) == 8  # both seed sets, three libraries on each
    assert {one.column for one in made["quality"]} == {None, "steps_8", "steps_16", "steps_24"}


@pytest.mark.parametrize("name", [name for name in PIPELINE if name != "settings"])
def test_a_stage_is_a_command_that_is_accepted(name):
    words = shlex.split(PIPELINE[name]["cmd"])
    assert words[:3] == ["python", "-m", "sidegan.run"]
    cfg = validate(composed(*words[3:]))
    assert cfg.named and set(cfg.stages) <= set(STAGES)
    assert cfg.scale.name == "paper"


def test_a_study_of_fewer_arms_overwrites_no_page():
    worth = APART["worth"]
    assert "publish" not in worth["cmd"] and not [path for path in paths(worth, "outs") if "docs/" in path]


def test_what_a_stage_depends_on_is_there_or_made_before_and_is_kept():
    before = set()
    for name, stage in PIPELINE.items():
        for path in paths(stage, "deps"):
            assert path in before or (ROOT / path).exists(), f"{name}: {path}"
        before |= {*paths(stage, "outs"), *paths(stage, "metrics")}
        for entry in [*stage["outs"], *stage.get("metrics", [])] if name != "settings" else []:
            assert next(iter(entry.values()))["persist"], name


def test_every_artifact_is_made_by_one_stage(made):
    outs = [Path(path) for stage in PIPELINE.values() for path in paths(stage, "outs")]
    for artifacts in made.values():
        for one in artifacts:
            folder = Path("outputs", one.shelf, one.label)
            assert sum(folder == out or out in folder.parents for out in outs) == 1, folder


def test_a_changed_setting_reruns_the_stage_that_it_is_of(tmp_path, made, monkeypatch):
    before, task = dvc.settings(made), dvc.task

    def changed(experiment, outputs):
        one = task(experiment, outputs)
        if not one.cfg.has("gan"):
            return one
        eigen = replace(one.cfg.gan["eigen"], width=128)
        return Task(replace(one.cfg, gan=one.cfg.gan | {"eigen": eigen}), one.store)

    monkeypatch.setattr(dvc, "task", changed)
    after = dvc.settings(dvc.parts(tmp_path))
    assert {name for name in after if after[name] != before[name]} == {
        "gan",
        "subsets",
        "ours_second",
        "ours_on_paper",
        "quality",
    }


def test_the_settings_are_those_of_the_stamps(made):
    settings = dvc.settings(made)
    seeds = settings["seeds"]["seeds/kuka_lwr4-gradient-seed0"]
    assert seeds["settings"]["seeds"]["count"] == 1800 and len(seeds["read"]["robot"]) == 64
