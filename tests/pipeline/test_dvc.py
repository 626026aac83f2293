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

from sidegan.pipeline.artifact import VERSIONS, versions
from tests.tiny import tiny

ROOT = Path(__file__).parents[2]
OTHERS = {"seeds", "identify"}  # makers that no condition of the paper has


def test_the_paper_is_run_by_stages_whose_files_and_versions_are_there():
    """What ``dvc repro`` would refuse, or would not notice, is told without starting it."""
    text = (ROOT / "dvc.yaml").read_text(encoding="utf-8")
    assert len(text.splitlines()) <= 120 and max(map(len, text.splitlines())) <= 120
    pipeline = yaml.safe_load(text)["stages"]
    outs = [one for stage in pipeline.values() for one in stage["outs"]]
    made = {str(next(iter(one)) if isinstance(one, dict) else one) for one in outs}
    needed = {dep for one in pipeline.values() for dep in one["deps"]} - made
    assert [path for path in needed if not (ROOT / path).exists()] == []
    assert ROOT / "params.yaml" == VERSIONS
    for small, others in ((False, OTHERS), (True, OTHERS - {"seeds"} | {"paper_seeds", "published_seeds"})):
        stages = [one for name, one in pipeline.items() if name.startswith("small") == small]
        keys = [key for one in stages for key in one.get("params", ())]
        assert len(set(keys)) == len(keys) and set(keys) == versions().keys() - others
        used = [name for one in stages for name in re.findall(r"stages=\[([\w,]+)\]", str(one["cmd"]))]
        assert {name for some in used for name in some.split(",")} == set(
            tiny(experiment="reproduction").stages
        )


def test_options_stand_behind_all_overrides():
    """Hydra takes overrides in one row, and refuses those behind ``-m`` where others stand before it."""
    written = yaml.safe_load((ROOT / "dvc.yaml").read_text(encoding="utf-8"))
    words = {key: str(value) for one in written["vars"] for key, value in one.items()}
    stages = [written["stages"][name] for name in ("random", "gan", "report", "small_gan")]
    for command in (Template(stage["cmd"]).substitute(words) for stage in stages):
        options = [one.startswith("-") for one in shlex.split(command)[3:]]
        assert options == sorted(options), command


@pytest.fixture
def dvc(tmp_path):
    """DVC in a repository of its own with our tracked files: arguments → the stages that it ran."""
    pytest.importorskip("dvc")
    files = subprocess.run(["git", "ls-files", "-z"], cwd=ROOT, capture_output=True).stdout
    copied = [one for one in files.decode().split("\0") if one.startswith(("conf", "experiments", "sidegan"))]
    for file in (*copied, "dvc.yaml", "params.yaml", ".dvc/config", ".dvcignore", ".gitignore"):
        if (ROOT / file).exists():
            (tmp_path / file).parent.mkdir(parents=True, exist_ok=True)
            (tmp_path / file).write_bytes((ROOT / file).read_bytes())
    environment = {**os.environ, "PYTHONPATH": str(tmp_path)}
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
    assert dvc("repro", "small") == ["small_seeds", "small_gan", "small_sets", "small"]
    assert dvc("repro", "small") == []
    assert dvc("metrics", "show") == [] == dvc("plots", "show")
    versions = tmp_path / "params.yaml"
    versions.write_text(versions.read_text().replace("density: 1", "density: 2"))
    assert dvc("repro", "small") == ["small"]
    assert len(list(tmp_path.glob("outputs/small/density/planar2-*"))) == 2
    eigen = tmp_path / "conf" / "gan" / "eigen.yaml"
    eigen.write_text(f"{eigen.read_text()}# another generator\n")
    assert dvc("repro", "small", "--dry") == ["small_gan"], "what follows is known when its results are there"
