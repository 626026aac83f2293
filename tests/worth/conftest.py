from pathlib import Path

import pytest

from sidegan.pipeline.stages.worth import constraints
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from tests.tiny import tiny


@pytest.fixture(scope="session")
def task(tmp_path_factory):
    """The tiny study of the planar arm."""
    root = Path(tmp_path_factory.mktemp("worth"))
    return Task(tiny(f"outputs={root}", experiment="worth"), Store(root))


@pytest.fixture(scope="session")
def place(task):
    return constraints(task)
