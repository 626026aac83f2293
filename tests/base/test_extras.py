"""What an installation without the extras does: all but what needs them, which says what installs it."""

import re
import subprocess
import sys
import tomllib
from pathlib import Path

import pytest

from tests.tiny import TINY

ROOT = Path(__file__).parents[2]
BARE = """
import sys
class Bare:  # a finder: importing these fails as where they are not installed
    def find_spec(self, name, *_):
        if name.partition(".")[0] in ("torch", "pygmo", "pytorch_lightning", "mlflow"):
            raise ModuleNotFoundError(name=name)
sys.meta_path.insert(0, Bare())
"""
MISSING = "{} is not installed; it comes with pip install 'sidegan[{}]'".format


DOORS = """
import sidegan.motion.dynamics, sidegan.pipeline.settings
assert "numba" not in sys.modules  # before dynamics are computed
from sidegan.errors import ConfigError
for name in ("train", "surrogates", "Generator"):
    try:
        getattr(sidegan, name)
    except ConfigError as error:
        print(error)
from importlib import import_module
from sidegan.pipeline.stages import STAGES, stage
for name in ("excite", "identify", "seeds", "trajectories"):
    import_module(f"sidegan.steps.{name}")
for name in STAGES:
    stage(name)
from sidegan.run import main
sys.exit(main())
"""


@pytest.fixture(scope="module")
def bare(tmp_path_factory):
    """A process that has none of the packages that extras bring, and the folder in which it makes seeds."""
    folder = tmp_path_factory.mktemp("bare")
    settings = [setting for setting in TINY if not setting.startswith("tracking")]
    words = "+experiment=exp1", *settings, "stages=[seeds]", "seeds.count=4", "tracking=local"
    command = [sys.executable, "-c", BARE + DOORS, *words]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True, timeout=600, check=False)
    assert done.returncode == 0, done.stderr
    return done, folder


def test_without_torch_only_training_is_unavailable(bare):
    """No settings, stage or other step imports it; it takes longer to import than all else."""
    assert bare[0].stdout.splitlines() == 3 * [MISSING("torch", "paper")]


def test_a_run_without_mlflow_continues_with_one_warning(bare):
    done, folder = bare
    assert done.stderr.count(MISSING("mlflow", "tracking")) == 1
    assert "continues without MLflow" in done.stderr and not list(folder.rglob("mlflow.db"))
    assert list(folder.glob("outputs/seeds/planar2-*"))


def test_every_extra_that_is_mentioned_exists():
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    files = [ROOT / "README.md", *ROOT.glob("docs/*.md"), *ROOT.glob("sidegan/**/*.py")]
    texts = [file.read_text(encoding="utf-8") for file in files]
    named = {name for text in texts for name in re.findall(r"sidegan\[([\w,]+)\]", text)}
    named |= {name for text in texts for name in re.findall(r"\b(?:extra|require)\(\"(\w+)\"", text)}
    assert {"paper", "tracking", "dask"} <= named
    assert {part for name in named for part in name.split(",")} <= project["optional-dependencies"].keys()
