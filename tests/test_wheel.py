"""A wheel holds what the commands need where there is no clone, and says what it is."""

import os
import re
import subprocess
import sys
import tomllib
import zipfile
from email.parser import Parser
from itertools import chain
from pathlib import Path

import pytest
from packaging.requirements import Requirement
from packaging.utils import canonicalize_name

import sidegan

ROOT = Path(__file__).parents[1]
HELD = ("sidegan", "conf", "params.yaml")


@pytest.fixture(scope="module")
def wheel(tmp_path_factory):
    """The wheel, unpacked into a folder far from the clone."""
    builders = pytest.importorskip("hatchling.builders.wheel")
    folder = tmp_path_factory.mktemp("wheel")
    (built,) = builders.WheelBuilder(str(ROOT)).build(directory=str(folder), versions=["standard"])
    with zipfile.ZipFile(built) as archive:
        archive.extractall(folder / "site")
    return folder / "site"


def tracked():
    """Files of the repository that a wheel is to hold, where it holds them."""
    listed = subprocess.run(["git", "ls-files", *HELD], cwd=ROOT, capture_output=True, text=True)
    files = [file for file in listed.stdout.split() if (ROOT / file).exists()]
    if not files:
        pytest.skip("this is no clone")
    return {file if file.startswith("sidegan/") else f"sidegan/{file}" for file in files}


def test_the_wheel_contains_exactly_our_files(wheel):
    held = {path.relative_to(wheel).as_posix() for path in wheel.rglob("*") if path.is_file()}
    assert tracked() | {"sidegan/py.typed"} <= held
    assert {path.split("/")[0] for path in held} == {"sidegan", f"sidegan-{sidegan.__version__}.dist-info"}
    assert not [path for path in held if path.endswith((".nbc", ".nbi", ".pyc"))]


def test_the_wheel_metadata_are_right(wheel):
    (info,) = wheel.glob("*.dist-info")
    said = Parser().parsestr((info / "METADATA").read_text(encoding="utf-8"))
    assert (said["Version"], said["License-Expression"]) == (sidegan.__version__, "Apache-2.0")
    assert (info / "licenses" / "LICENSE").read_bytes() == (ROOT / "LICENSE").read_bytes()
    assert {"paper", "tracking", "dev"} <= set(said.get_all("Provides-Extra"))
    base = {
        requirement.partition(">")[0]
        for requirement in said.get_all("Requires-Dist")
        if "extra ==" not in requirement
    }
    assert "pin" in base and not base & {"torch", "pygmo", "pytorch-lightning", "mlflow"}
    cited = (ROOT / "CITATION.cff").read_text(encoding="utf-8")
    assert f"\nversion: {sidegan.__version__}\n" in cited


WHERE = """
from sidegan.pipeline.artifact import versions
from sidegan.base.conf import CONF
print(CONF, versions()["gan"] > 0)
"""


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["-c", WHERE], "site/sidegan/conf True"),
        (["-m", "sidegan.run", "--help"], "+experiment=excite"),
        (["-m", "sidegan.run", "+experiment=excite", "--cfg", "job"], "experiment: excite"),
    ],
)
def test_the_command_runs_from_the_wheel_without_a_clone(wheel, tmp_path, arguments, words):
    """Settings are the package's own copy of conf/, which goes before the one beside the package."""
    elsewhere = os.environ | {"PYTHONPATH": str(wheel)}
    command = [sys.executable, "-P", *arguments]
    ran = subprocess.run(command, cwd=tmp_path, env=elsewhere, capture_output=True, text=True, timeout=300)
    assert ran.returncode == 0 and words in ran.stdout, ran.stderr


def test_every_requirement_is_pinned_to_an_allowed_version():
    lines = (ROOT / "constraints.txt").read_text(encoding="utf-8").splitlines()
    pins = dict(re.match(r"([\w.-]+)==([^ ;]+)", line).groups() for line in lines if line[0] != "#")
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    groups = [project["dependencies"], *project["optional-dependencies"].values()]
    for requirement in map(Requirement, chain.from_iterable(groups)):
        if requirement.name != "sidegan":
            assert requirement.specifier.contains(pins[canonicalize_name(requirement.name)]), requirement
    torchs = [name for name in pins if name.startswith(("nvidia", "cuda"))]
    assert not torchs, "torch names these itself, those of each of its builds"
