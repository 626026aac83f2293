"""The pipeline of dvc.yaml: what it names is there, and a change makes anew what depends on it alone."""

import os
import re
import shlex
import subprocess
import sys
from pathlib import Path
from string import Template

import pytest
import yaml
from hydra.core.override_parser.overrides_parser import OverridesParser

from sidegan.pipeline.artifact import versions
from sidegan.pipeline.places import VERSIONS
from tests.tiny import tiny

ROOT = Path(__file__).parents[2]
# Pipelines by their folder, each with makers that its conditions do not have.
PIPELINES = {
    "": {"seeds", "published_seeds", "identify"},
    "published": {"seeds", "paper_seeds", "identify"},
    "small": {"paper_seeds", "published_seeds", "identify"},
}

SPARED = "parallel.workers=1 tracking=off plants.plant.rate=250 discussion.sizes=[]"


@pytest.fixture(params=PIPELINES, ids=lambda name: name or "root")
def pipeline(request):
    """The folder of a pipeline, and its stages as they are written, with the variables put in."""
    text = (ROOT / request.param / "dvc.yaml").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 80 and max(map(len, text.splitlines())) <= 120
    written = yaml.safe_load(text)
    words = {key: str(value) for variables in written["vars"] for key, value in variables.items()}
    for stage in written["stages"].values():
        commands = stage["cmd"] if isinstance(stage["cmd"], list) else [stage["cmd"]]
        stage["cmd"] = [Template(command).substitute(words) for command in commands]
    return request.param, written["stages"]


def test_every_stage_is_run_from_files_that_are_there(pipeline):
    """What ``dvc repro`` would refuse, or would not notice, is told without starting it."""
    folder, stages = pipeline
    outs = [out for stage in stages.values() for out in stage["outs"]]
    made = {str(next(iter(out)) if isinstance(out, dict) else out) for out in outs}
    needed = {dep for stage in stages.values() for dep in stage.get("deps", ())} - made
    assert [path for path in needed if not (ROOT / folder / path).exists()] == []
    assert ROOT / "params.yaml" == VERSIONS
    keys = [key for stage in stages.values() for key in stage.get("params", ())]
    if folder:
        keys = [key for params in keys for key in params["../params.yaml"]]
    assert len(set(keys)) == len(keys) and set(keys) == versions().keys() - PIPELINES[folder]
    commands = " ".join(command for stage in stages.values() for command in stage["cmd"])
    used = re.findall(r"stages=\[([\w,]+)\]", commands)
    stages = tiny(experiment="reproduction").stages
    assert {name for some in used for name in some.split(",")} == set(stages)


def test_hydra_reads_every_command(pipeline):
    """Its options stand on one side of all overrides, each of which it can parse."""
    commands = (command for stage in pipeline[1].values() for command in stage["cmd"])
    for words in (shlex.split(command) for command in commands if "sidegan.run" in command):
        words = words[words.index("python") + 3 :]
        options = [word.startswith("-") for word in words]
        assert options == sorted(options) or options == sorted(options, reverse=True), words
        OverridesParser.create().parse_overrides([word for word in words if not word.startswith("-")])


@pytest.fixture
def dvc(tmp_path):
    """DVC in a repository of its own with the files that it watches: arguments → the stages that it ran.

    The package is that of the clone, whose kernels are compiled: numba would compile a copy's anew. Stages
    are spared what takes longer than their work: workers, MLflow, and variants that no claim is about.
    """
    pytest.importorskip("dvc")
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True).stdout
    kept = "conf", "experiments", "small", "dvc.", "params.", ".dvc", ".gitignore"
    for file in (name for name in files.decode().split("\0") if name.startswith(kept)):
        (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
        (tmp_path / file).write_bytes((ROOT / file).read_bytes())
    pipeline = tmp_path / "small" / "dvc.yaml"
    pipeline.write_text(pipeline.read_text().replace("scale=tiny", f"scale=tiny {SPARED}"))
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    environment["PATH"] = f"{Path(sys.executable).parent}{os.pathsep}{environment['PATH']}"

    def run(*arguments):
        words = [sys.executable, "-m", "dvc", *arguments]
        done = subprocess.run(words, cwd=tmp_path, env=environment, capture_output=True, text=True)
        assert done.returncode == 0, f"{done.stdout}{done.stderr}"
        return re.findall(r"Running stage '(\w+)'", done.stdout)

    subprocess.run(["git", "init", "-q"], cwd=tmp_path, check=True)
    return run


@pytest.mark.slow
def test_the_small_scale_is_made_once_and_a_change_makes_anew_what_depends_on_it(dvc, tmp_path):
    small = "--cd", "small"
    assert dvc(*small, "repro") == ["seeds", "gan", "sets", "report"]
    assert dvc(*small, "repro") == []
    assert dvc(*small, "metrics", "show") == [] == dvc(*small, "plots", "show")
    versions = tmp_path / "params.yaml"
    versions.write_text(re.sub(r"\bdensity: \d+", "density: 99", versions.read_text()))
    assert dvc(*small, "repro", "--dry") == ["report"]
    eigen = tmp_path / "conf" / "gan" / "eigen.yaml"
    eigen.write_text(f"{eigen.read_text()}# another generator\n")
    assert dvc(*small, "repro", "--dry") == ["gan", "report"]  # the rest follows from gan's results
