"""A wheel holds what the commands need where there is no clone."""

import subprocess
import sys
from pathlib import Path

import pytest

ROOT = Path(__file__).parents[1]
HELD = ("sidegan", "conf", "params.yaml")


def tracked():
    """Files of the repository that a wheel is to hold, where it holds them."""
    listed = subprocess.run(["git", "ls-files", *HELD], cwd=ROOT, capture_output=True, text=True)
    files = listed.stdout.split()
    if not files:
        pytest.skip("this is no clone")
    return {file if file.startswith("sidegan/") else f"sidegan/{file}" for file in files}


def test_every_file_of_ours_is_in_the_wheel_and_nothing_else():
    wheel = pytest.importorskip("hatchling.builders.wheel")
    builder = wheel.WheelBuilder(str(ROOT))
    with builder.config.set_build_data({"artifacts": [], "force_include": {}}):
        held = {one.distribution_path for one in builder.recurse_included_files()}
    there = {f for f in tracked() if (ROOT / f).exists() or (ROOT / f.removeprefix("sidegan/")).exists()}
    assert there <= held
    assert {path.split("/")[0] for path in held} == {"sidegan"}
    assert not [path for path in held if path.endswith((".nbc", ".nbi", ".pyc"))]


CODE = """
import shutil, sys
from pathlib import Path
root = Path(sys.argv[1])
shutil.copytree(root / "sidegan", "sidegan", ignore=shutil.ignore_patterns("__pycache__"))
shutil.copytree(root / "conf", "sidegan/conf")
shutil.copy(root / "params.yaml", "sidegan/params.yaml")
sys.path.insert(0, ".")
from sidegan.pipeline.places import CONF
from sidegan.pipeline.artifact import version
from sidegan.run import main
assert CONF == Path("sidegan/conf").resolve() and version("gan"), CONF
sys.argv = ["sidegan", "+experiment=excite", "--cfg", "job"]
sys.exit(main())
"""


def test_settings_are_found_in_the_wheel_where_there_is_no_clone(tmp_path):
    """The package's own copy of conf/, as the wheel has it, goes before the one beside the package."""
    command = [sys.executable, "-I", "-c", CODE, str(ROOT)]
    ran = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0, ran.stderr
    assert "experiment: excite" in ran.stdout
