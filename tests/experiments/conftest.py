import pytest

from experiments import reproduction
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.store import Store
from tests.tiny import tiny


@pytest.fixture(scope="session")
def page(outputs, tmp_path_factory):
    """Folder of the published page of a whole tiny run."""
    folder = tmp_path_factory.mktemp("reproduction")
    config = tiny(f"outputs={outputs}", f"publish={folder}/docs", experiment="reproduction")
    run_stages(config, folder, "first")
    return folder / "docs"


@pytest.fixture(scope="session")
def artifacts(outputs, page):
    """What that run left."""
    config = tiny(f"outputs={outputs}", experiment="reproduction")
    return reproduction.collect(RunContext(config, Store(outputs)))["ours"]
