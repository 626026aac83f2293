import json

import pandas as pd
import pytest

from experiments import conditional
from sidegan.errors import ArtifactError, ConfigError, InfeasibleError
from sidegan.library import Library
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages.conditional import STAGE, Conditions
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import LIBRARY, Task
from tests.tiny import tiny


def run(root, folder, *overrides):
    config = tiny(f"outputs={root}", *overrides, experiment="conditional")
    run_stages(config, folder, "conditional")
    return folder


@pytest.fixture(scope="module")
def study(outputs, tmp_path_factory):
    """Folder of a run of the study."""
    return run(outputs, tmp_path_factory.mktemp("study"))


def artifacts(root, *overrides):
    """Folders of the artifacts of the stage."""
    task = Task(tiny(f"outputs={root}", *overrides, experiment="conditional"), Store(root))
    return {folder: folder.stat().st_ino for folder in map(task.store.require, STAGE.artifacts(task))}


def test_the_study_leaves_its_tables(study, outputs):
    table = pd.read_csv(study / "conditions.csv", index_col=0)
    assert list(table.index) == ["none", "home", "period", "effort", "plane", "links", "all"]
    assert table.loc["period", "ratio"] == "—" and float(table.loc["effort", "ratio"]) > 0
    assert table["met"].str.endswith("%").all()
    report = json.loads((study / "study.json").read_text())
    assert {"links", "parameters", "variance", "worst", "others"} == set(report["links"][0])
    assert len(artifacts(outputs)) == 4  # one for all conditions, two for one each, and the study


def test_a_second_run_makes_nothing(study, outputs, tmp_path):
    before = artifacts(outputs)
    run(outputs, tmp_path)
    assert artifacts(outputs) == before


def test_what_is_asked_comes_as_a_library(study, outputs, tmp_path):
    ask = "conditional.ask={effort: 0.6, period: 10, plane: 0.15, home: [0.1, -0.1], links: {forearm: 2}}"
    before = artifacts(outputs)
    folder = run(outputs, tmp_path, ask)
    library = Library.load(folder / LIBRARY)
    assert len(library) == 5 and library.valid.all()
    assert (library.period, library.home) == (10.0, (0.1, -0.1))
    requested = artifacts(outputs, ask)
    assert len(requested) == 2 and len(requested.keys() & before) == 1  # the generator is the study's
    facts = pd.read_csv(folder / "library.csv", index_col=0)["value"]
    assert facts["trajectories"] == "5" and facts["met"].endswith("%")


@pytest.mark.parametrize(
    ("override", "kind", "words"),
    [
        ("conditional.ask={period: 99}", ConfigError, r"conditional\.ask: period is \[99.0\]"),
        ("conditional.ask={links: {hand: 1}}", ConfigError, "'hand', expected some of upper_arm"),
        ("conditional.ask={walls: [0.5, 0.5]}", ConfigError, r"conditional\.ask: walls"),
        ("conditional.ask={home: [0.1]}", ConfigError, r"conditional\.ask: home"),
        ("conditional.ranges.velocity=[1, 0.5]", ConfigError, r"conditional\.ranges: velocity"),
        ("conditional.ranges.period=[20, 30]", ConfigError, r"conditional\.ranges: period"),
        ("conditional.study.compared=[walls]", ConfigError, r"compared has 'walls'"),
        ("trajectory.home=[0, 2.85]", InfeasibleError, "collision of base"),
    ],
)
def test_what_cannot_be_done_is_refused_before_any_work(tmp_path, override, kind, words):
    with pytest.raises(kind, match=words):
        run(tmp_path, tmp_path / "run", override)
    assert not list(tmp_path.glob("conditional/*"))


def test_effort_stands_for_velocity_and_torque_alone():
    with pytest.raises(ConfigError, match="give it or them"):
        tiny("conditional.ask={effort: 0.5, torque: 0.5}", experiment="conditional")


def test_groups_must_fill_a_batch():
    with pytest.raises(ConfigError, match="multiple of together=4"):
        tiny("conditional.training.batch=10", experiment="conditional")


def test_an_asked_library_has_no_study(tmp_path):
    config = tiny(f"outputs={tmp_path}", "conditional.ask={effort: 0.6}", experiment="conditional")
    task = Task(config, Store(tmp_path))
    assert Conditions(task).requested is not None
    with pytest.raises(ArtifactError, match="there is no conditional/planar2-asked-seed0"):
        conditional.collect(task)
