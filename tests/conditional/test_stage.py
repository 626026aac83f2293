import json

import pandas as pd
import pytest
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.plan import LIBRARY, Task

from experiments import conditional
from sidegan.errors import ConfigError, InfeasibleError
from sidegan.library import Library
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import STAGES
from tests.tiny import tiny

FEW = (
    "conditional.ranges.obstacle=null",
    "conditional.ranges.walls=null",
    "conditional.ranges.home=0.2",
    "conditional.training.batch=8",
    "conditional.training.samples=16",
    "conditional.study.compared=[effort]",
    "conditional.study.count=2",
    "conditional.study.pool=8",
    "conditional.study.chosen=6",
    "conditional.count=5",
)


def run(root, name, *overrides):
    config = tiny(f"outputs={root}", *FEW, *overrides, experiment="conditional")
    run_stages(config, root / "runs" / name, name, STAGES)
    return root / "runs" / name


@pytest.fixture(scope="module")
def root(tmp_path_factory):
    made = tmp_path_factory.mktemp("outputs")
    run(made, "study")
    return made


def artifacts(root):
    return {path.parent.name: path.stat().st_mtime_ns for path in root.glob("conditional/*/stamp.json")}


def test_the_study_leaves_its_tables(root):
    table = pd.read_csv(root / "runs" / "study" / "conditions.csv", index_col=0)
    assert list(table.index) == ["none", "home", "period", "effort", "plane", "links", "all"]
    assert table.loc["period", "ratio"] == "—" and float(table.loc["effort", "ratio"]) > 0
    assert table["met"].str.endswith("%").all()
    study = json.loads((root / "runs" / "study" / "study.json").read_text())
    assert {"links", "parameters", "variance", "worst", "others"} == set(study["links"][0])
    assert len(artifacts(root)) == 4  # one for all conditions, two for one each, and the study


def test_a_second_run_makes_nothing(root):
    before = artifacts(root)
    run(root, "again")
    assert artifacts(root) == before


def test_what_is_asked_comes_as_a_library(root):
    before = artifacts(root)
    ask = "conditional.ask={effort: 0.6, period: 10, plane: 0.15, home: [0.1, -0.1], links: {forearm: 2}}"
    folder = run(root, "ask", ask)
    library = Library.load(folder / LIBRARY)
    assert len(library) == 5 and library.valid.all()
    assert (library.period, library.home) == (10.0, (0.1, -0.1))
    assert len(artifacts(root)) == len(before) + 1  # the generator is there
    told = pd.read_csv(folder / "library.csv", index_col=0)["value"]
    assert told["trajectories"] == "5" and told["met"].endswith("%")


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
        run(tmp_path, "bad", override)
    assert not artifacts(tmp_path)


def test_effort_stands_for_velocity_and_torque_alone():
    with pytest.raises(ConfigError, match="give it or them"):
        tiny("conditional.ask={effort: 0.5, torque: 0.5}", experiment="conditional")


def test_groups_must_fill_a_batch():
    with pytest.raises(ConfigError, match="multiple of together=4"):
        tiny("conditional.training.batch=10", experiment="conditional")


def test_an_asked_library_has_no_study(root):
    config = tiny(f"outputs={root}", *FEW, "conditional.ask={effort: 0.6}", experiment="conditional")
    with pytest.raises(Exception, match="there is no conditional"):
        conditional.collect(Task(config, Store(root)))
