"""Wrong arguments are refused by name, before anything is written."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import sidegan as sg
from sidegan.errors import ConfigError, InfeasibleError, RecordingError, ShapeError
from tests.refusals import refused

FROM_HORIZONTAL = {"elbow": {"elbow": 1, "shoulder": -1}}  # as the controller counts the second angle
TURNED = {"regions": [{"mesh": {"file": "a.stl", "rpy": [90, 0, 0]}}]}
NO_HOME = {"regions": [{"mesh": {"file": "~nobody_here/a.stl"}}]}
# What the message names, commas between, and the call: of a cell, and of a set with a small motion of the
# shoulder and one beyond its range.
WRONG = {
    ConfigError: [
        (
            "controllers.formats, urscript",
            lambda cell, it: it[:1].save("set", {"formats": ["urscript"]}),
        ),
        ("careful, 5.0", lambda cell, it: it[:1].save("set", sg.ExportSettings(careful=5.0))),
        (
            "start, -30 for elbow, [0.6981, -0.5236]",
            lambda cell, it: it[:1].save("set", {"start": [40, -30], "coupling": FROM_HORIZONTAL}),
        ),
        ("rehearse", lambda cell, it: it.save("set", {"rehearse": True})),
        ("speed, 0", lambda cell, it: it.at_speed(0)),
        ("period, 100000", lambda cell, it: it.at_speed(1e-9)),
        ("method, best", lambda cell, it: it.select(1, "best")),
        ("greedy, noise", lambda cell, it: it.select(1, noise=[1, 1])),
        ("folder, 5", lambda cell, it: it[:1].save(5)),
        ("folder, None", lambda cell, it: sg.TrajectorySet.load(None, cell)),
        ("planar2, Cell", lambda cell, it: sg.TrajectorySet.load("set", "planar2")),
        ("effort, 3", lambda cell, it: sg.Cell("planar2", effort=3)),
        ("tipp, tip", lambda cell, it: sg.Cell("planar2", tipp="x")),
        ("degrees", lambda cell, it: sg.Cell("planar2", workspace=TURNED)),
        ("robot, None", lambda cell, it: sg.Cell(None)),
        ("clearance, -1", lambda cell, it: sg.Cell("planar2", workspace=sg.Workspace(clearance=-1.0))),
        ("planar2, Cell", lambda cell, it: sg.excite("planar2", 1)),
        ("Cell('planar2')", lambda cell, it: sg.excite(Path("planar2"), 1)),
        ("Cell('arm.urdf')", lambda cell, it: sg.excite(None, 1)),
        ("~nobody_here/a.stl", lambda cell, it: sg.Cell("planar2", workspace=NO_HOME).constraints),
        ("~nobody_here/a.stl", lambda cell, it: sg.Cell("planar2", workspace=NO_HOME).stamped()),
        ("count, 0", lambda cell, it: sg.excite(cell, 0)),
        ("seed, -1", lambda cell, it: sg.excite(cell, 1, seed=-1)),
        ("parameters, GoalSettings", lambda cell, it: sg.excite(cell, goal="parameters")),
        ("known, 3", lambda cell, it: sg.excite(cell, 1, known=3)),
        ("folder, 5", lambda cell, it: sg.seeds(cell, 2, folder=5)),
        ("papers, gradient", lambda cell, it: sg.seeds(cell, settings={"method": "papers"})),
        ("published", lambda cell, it: sg.seeds(cell, settings={"method": "published"})),
        ("settings, 3, Seeds", lambda cell, it: sg.seeds(cell, settings=3)),
        ("count, '3'", lambda cell, it: sg.seeds(cell, "3")),
        ("seed, 1.5", lambda cell, it: sg.seeds(cell, 2, 1.5)),
        ("workers, -3", lambda cell, it: sg.seeds(cell, 3, workers=-3)),
        ("folder, 5", lambda cell, it: sg.surrogates(cell, it, 5)),
        ("path, None", lambda cell, it: sg.Generator.load(None, cell)),
        ("eigne", lambda cell, it: sg.train("eigne", cell)),
        ("eigen, seeds", lambda cell, it: sg.train("eigen", cell)),
        (
            "weigths, weights",
            lambda cell, it: sg.train({"_target_": "sidegan.gan.variants.Vanilla", "weigths": {}}, cell, it),
        ),
        ("surrogates, {}", lambda cell, it: sg.train("eigen", cell, it, surrogates={})),
        ("box, -1", lambda cell, it: sg.train("vanilla", cell, it, box=-1)),
        ("box, True", lambda cell, it: sg.train("vanilla", cell, it, box=True)),
        ("box, inf", lambda cell, it: sg.train("vanilla", cell, it, box=np.inf)),
        ("box, 0.001", lambda cell, it: sg.train("vanilla", cell, it[[0, 0]], box=0.001)),
        ("2 seeds", lambda cell, it: sg.train("vanilla", cell, it[[0, 0]])),
        ("planar2, Cell", lambda cell, it: sg.identify("planar2", ["a.csv"])),
        ("recordings", lambda cell, it: sg.identify(cell, None)),
        ("recordings", lambda cell, it: sg.identify(cell, [])),
        ("recording 2", lambda cell, it: sg.identify(cell, ["a.csv", ""])),
        ("sign_width, 0", lambda cell, it: sg.check_recordings(cell, "a.csv", sign_width=0)),
        ("recording 1, empty", lambda cell, it: sg.identify(cell, pd.DataFrame())),
        ("recording 1, ndarray", lambda cell, it: sg.identify(cell, np.zeros((2, 3)))),
        ("recording 1, column t", lambda cell, it: sg.identify(cell, pd.DataFrame({"t": [1, "a"]}))),
        ("position, effort", lambda cell, it: sg.identify(cell, {"position": it.to_frame(100)})),
        ("validation, -0.5", lambda cell, it: sg.identify(cell, "a.csv", -0.5)),
        ("validation, 30", lambda cell, it: sg.identify(cell, "a.csv", 30)),
        ("gains, 1.0", lambda cell, it: sg.identify(cell, "a.csv", gains=1.0)),
        ("gains, nan", lambda cell, it: sg.identify(cell, "a.csv", gains=[2, float("nan")])),
    ],
    ShapeError: [
        ("rate, '100'", lambda cell, it: it.to_frame("100")),
        ("coefficients", lambda cell, it: sg.TrajectorySet.of(cell, np.zeros((0, 2, 3, 2)))),
        ("coefficients", lambda cell, it: sg.TrajectorySet.of(cell, "abc")),
        ("(2, 2, 2, 3, 2)", lambda cell, it: sg.TrajectorySet.of(cell, [it, it])),
        ("period=16.0, period=8.0", lambda cell, it: cell.check(it[:1].at_speed(0.5))),
        ("position", lambda cell, it: cell.torque("a", 0, 0)),
        ("noise, 1.0", lambda cell, it: it.select(1, "d_optimal", noise=[1])),
        ("[], 2", lambda cell, it: it[[]]),
        ("4, 1 valid", lambda cell, it: it.select(4)),
        ("=8.0, =16.0", lambda cell, it: sg.train("vanilla", sg.Cell("planar2", harmonics=3), it)),
        ("seeds, 0, two", lambda cell, it: sg.train("vanilla", cell, np.zeros((0, 2, 3, 2)))),
        ("seeds, 1, two", lambda cell, it: sg.surrogates(cell, it[:1], "there")),
        ("coefficients", lambda cell, it: sg.train("vanilla", cell, [])),
    ],
    InfeasibleError: [
        ("position of shoulder", lambda cell, it: it.save("set")),
        ("trajectory 2, 50%, effort=…, period=…", lambda cell, it: it.at_speed(0.5)),
        ("1 of 2 seeds, position of shoulder", lambda cell, it: sg.train("vanilla", cell, it)),
        ("1 of 2 seeds, position of shoulder", lambda cell, it: sg.surrogates(cell, it, "there")),
    ],
    RecordingError: [("a.csv", lambda cell, it: sg.identify(cell, Path("a.csv")))],
}


@pytest.mark.parametrize(("kind", "about", "wrong"), [(kind, *row) for kind in WRONG for row in WRONG[kind]])
def test_a_wrong_argument_is_refused_by_name(kind, about, wrong, cell, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    c = np.zeros((2, 2, 3, 2))
    c[:, 0, 2, 1] = 0.05, 5
    with refused(kind, *about.split(", ")):
        wrong(cell, sg.TrajectorySet.of(cell, c))
    assert not [*tmp_path.rglob("*.csv"), *tmp_path.rglob("*.script")]
