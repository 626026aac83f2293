from pathlib import Path

import pytest

from sidegan.pipeline.settings import validate
from sidegan.pipeline.stages.worth import constraints
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from tests.tiny import composed, tiny

PLANAR = ("scale=tiny", "robot=planar2", "workspace=free", "tracking=off", "parallel.workers=1")


@pytest.fixture(scope="session")
def task(tmp_path_factory):
    """The tiny study of the planar arm with every contender."""
    root = Path(tmp_path_factory.mktemp("worth"))
    return Task(validate(composed("+experiment=worth", *PLANAR, f"outputs={root}")), Store(root))


@pytest.fixture(scope="session")
def small(outputs):
    """The same with a few contenders and without the second family of misfits."""
    return Task(tiny(f"outputs={outputs}", experiment="worth"), Store(outputs))


@pytest.fixture(scope="session")
def place(task):
    return constraints(task)
