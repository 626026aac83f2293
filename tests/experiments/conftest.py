from importlib import import_module

import pytest
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.plan import Task

from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import STAGES


@pytest.fixture(scope="module")
def root(request, tmp_path_factory):
    """Root of a whole tiny run of the module's experiment, its page published."""
    folder = tmp_path_factory.mktemp("outputs")
    config = request.module.config(folder, f"publish={folder}/docs")
    run_stages(config, folder / "runs" / "first", "first", STAGES)
    return folder


@pytest.fixture(scope="module")
def artifacts(request, root):
    """What that run left, as its experiment collects it."""
    experiment = import_module(f"experiments.{request.module.PAGE}")
    return experiment.collect(Task(request.module.config(root), Store(root)))


@pytest.fixture(scope="module")
def page(request, root):
    """The published page, whose links all lead to a file, and the stems of its tables."""
    docs, name = root / "docs", request.module.PAGE
    text = (docs / f"{name}.md").read_text(encoding="utf-8")
    for link in [part.partition(")")[0] for part in text.split("](")[1:]]:
        assert (docs / link).is_file(), link
    return text, {path.stem for path in (docs / name / "tables").glob("*.csv")}
