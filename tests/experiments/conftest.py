from importlib import import_module

import pytest

from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import timing
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from tests.tiny import tiny


@pytest.fixture(scope="module")
def run(request, outputs, tmp_path_factory):
    """Folder of a whole tiny run of the module's experiment, its page published in ``docs`` there."""
    folder = tmp_path_factory.mktemp(request.module.PAGE)
    config = tiny(f"outputs={outputs}", f"publish={folder}/docs", experiment=request.module.PAGE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(timing, "_SECONDS", 0.1)
        run_stages(config, folder, "first")
    return folder


@pytest.fixture(scope="module")
def artifacts(request, outputs, run):
    """What that run left, as its experiment collects it."""
    experiment = import_module(f"experiments.{request.module.PAGE}")
    config = tiny(f"outputs={outputs}", experiment=request.module.PAGE)
    return experiment.collect(Task(config, Store(outputs)))


@pytest.fixture(scope="module")
def page(request, run):
    """The published page, whose links all lead to a file, and the stems of its tables."""
    docs, name = run / "docs", request.module.PAGE
    text = (docs / f"{name}.md").read_text(encoding="utf-8")
    for link in [part.partition(")")[0] for part in text.split("](")[1:]]:
        assert (docs / link).is_file(), link
    return text, {path.stem for path in (docs / name / "tables").glob("*.csv")}
