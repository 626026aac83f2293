"""The pipelines of dvc.yaml: their parts fit together."""

import re
import shlex
from importlib import import_module
from pathlib import Path
from string import Template

import pytest
import yaml

from sidegan.base.conf import VERSIONS
from sidegan.pipeline.artifact import Artifact, stage_of, versions
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.settings import validate
from sidegan.pipeline.stages import stage as stage_named
from sidegan.pipeline.store import Store
from tests.tiny import composed, tiny

ROOT = Path(__file__).parents[2]
# Pipelines by their folder, each with makers that its conditions do not have.
PIPELINES = {
    "": {"seeds", "published_seeds", "identify"},
    "published": {"seeds", "paper_seeds", "identify"},
    "small": {"paper_seeds", "published_seeds", "short", "identify"},
}


def listed(entries):
    """Entries of a list in dvc.yaml, without their options."""
    return [next(iter(entry)) if isinstance(entry, dict) else entry for entry in entries]


@pytest.fixture(params=PIPELINES, ids=lambda name: name or "root")
def pipeline(request):
    """The folder of a pipeline, and its file, with the variables put in."""
    folder = request.param
    written = yaml.safe_load((ROOT / folder / "dvc.yaml").read_text(encoding="utf-8"))
    words = {key: str(value) for variables in written["vars"] for key, value in variables.items()}
    for stage in written["stages"].values():
        commands = stage["cmd"] if isinstance(stage["cmd"], list) else [stage["cmd"]]
        stage["cmd"] = [Template(command).substitute(words) for command in commands]
        makers = stage.get("params", [])
        stage["makers"] = makers[0]["../params.yaml"] if folder and makers else makers
        stage["outs"], stage["deps"] = listed(stage["outs"]), stage.get("deps", [])
    return folder, written


def run_by(stage):
    """Stages of ours that a stage of DVC runs, a list for each command."""
    return [found.split(",") for found in re.findall(r"stages=\[([\w,]+)\]", " ".join(stage["cmd"]))]


def test_every_stage_is_run_from_files_that_are_there(pipeline):
    """What ``dvc repro`` would refuse, or would not notice, is told without starting it."""
    folder, written = pipeline
    stages = written["stages"]
    made = {out for stage in stages.values() for out in stage["outs"]}
    needed = {dep for stage in stages.values() for dep in stage["deps"]} - made
    assert [path for path in needed if not (ROOT / folder / path).exists()] == []
    shown = map(Path, [*written.get("metrics", []), *written.get("plots", [])])
    assert all(made & {str(part) for part in (path, *path.parents)} for path in shown)
    assert ROOT / "params.yaml" == VERSIONS
    makers = [maker for stage in stages.values() for maker in stage["makers"]]
    assert len(set(makers)) == len(makers) and set(makers) == versions().keys() - PIPELINES[folder]


def test_every_stage_runs_again_when_a_setting_is_edited(pipeline):
    """Any file of conf/ and any dataclass may hold a number that a stage reads; a needless run is short."""
    folder, written = pipeline
    settings, *others = written["stages"].values()
    edited = [*(ROOT / "conf").rglob("*.yaml"), *(ROOT / "sidegan").rglob("settings.py")]
    watched = {(ROOT / folder / dep).resolve() for dep in settings["deps"]}
    assert [path for path in edited if watched.isdisjoint((path, *path.parents))] == []
    running = [stage for stage in others if any("sidegan.run" in command for command in stage["cmd"])]
    assert running and all(settings["outs"][0] in stage["deps"] for stage in running)


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Other stages whose artifacts each stage needs."""
    run = RunContext(tiny(experiment="reproduction"), Store(tmp_path_factory.mktemp("store")))
    read = {}
    for name in run.cfg.stages:
        made = {artifact.digest: artifact for artifact in stage_named(name).artifacts(run)}
        sources = (source for artifact in made.values() for source in artifact.inputs.values())
        others = (x for x in sources if isinstance(x, Artifact) and x.digest not in made)
        read[name] = {stage_of(source.maker) for source in others}
    read["table"] = read.keys() - {"table", "subsets"}  # whose artifacts are those of gan and surrogates
    return read


def test_every_stage_makes_its_outputs_and_depends_on_what_they_are_made_from(pipeline, inputs):
    stages = pipeline[1]["stages"].values()
    assert {name for stage in stages for some in run_by(stage) for name in some} == inputs.keys()
    for stage in stages:
        own = {name for some in run_by(stage) for name in some}
        for some in run_by(stage):
            assert all(inputs[name].isdisjoint(some[k:]) for k, name in enumerate(some))
        assert {stage_of(maker) for maker in stage["makers"]} == own - {"subsets", "table"}
        made = [out for out in stage["outs"] if re.fullmatch(r"outputs/\w+", out)]
        assert made == [f"outputs/{maker}" for maker in stage["makers"]] or "table" in own
        known = {stage_of(dep.removeprefix("outputs/")) for dep in stage["deps"]} | own
        for _ in inputs:  # what is needed by what is watched is watched too
            known.update(*(inputs.get(name, ()) for name in known - own))
        assert set().union(*(inputs[name] for name in own)) <= known


def test_every_command_composes_valid_settings_or_runs_a_module_that_imports(pipeline):
    commands = [command for stage in pipeline[1]["stages"].values() for command in stage["cmd"]]
    for module in re.findall(r"-m (experiments\.\w+)", " ".join(commands)):
        import_module(module)
    for words in (shlex.split(command) for command in commands if "sidegan.run" in command):
        validate(composed(*(word for word in words[words.index("sidegan.run") :] if "=" in word)))
