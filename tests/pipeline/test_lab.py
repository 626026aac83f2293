"""Drive gains, and sets designed for what a known model lacks, through their commands."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from sidegan.errors import ConfigError
from sidegan.identification.payload import Gains
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.settings import validate
from sidegan.pipeline.stages.payload import gains_table
from sidegan.recording.recording import Recording
from sidegan.robot import load_robot
from sidegan.steps.excite import known_model
from tests.identification.test_payload import CENTRE, LOAD, MASS, TRUE, runs
from tests.recording.conftest import moved
from tests.recording.files import frame, write_bag
from tests.refusals import refused
from tests.tiny import composed

NOISE = 0.2


def ran(outputs, experiment, *overrides):
    """Folder of a run."""
    folder = outputs / "runs" / experiment
    common = (f"+experiment={experiment}", "tracking=off", "parallel.workers=1", f"outputs={outputs}")
    run_stages(validate(composed(*common, *overrides)), folder, experiment)
    return folder


@pytest.fixture(scope="module")
def files(arm, tmp_path_factory):
    """Currents of 20 s at 100 Hz, without a load and with it."""
    folder = tmp_path_factory.mktemp("files")
    for seed, (name, carried) in enumerate({"free": 0 * LOAD, "laden": LOAD}.items()):
        data = runs(arm, carried, seed, NOISE, 2000)
        signals = {"position": data.position, "velocity": data.velocity, "current": data.torque / TRUE}
        recording = Recording(name, arm.joint_names, np.arange(2000) / 100, **signals)
        frame(recording).to_csv(folder / f"{name}.csv", index=False)
        bag = replace(recording, torque=recording.current, current=None)  # written as efforts
        write_bag(bag, folder / name)
    return folder


@pytest.mark.parametrize(("free", "laden"), [("free.csv", "laden.csv"), ("free/bag", "laden/bag")])
def test_the_gains_command_finds_the_drive_gains(files, tmp_path, free, laden):
    given = "robot=kuka_lwr4", f"recordings=[{files / free}]", f"loaded=[{files / laden}]"
    place = ",".join(map(str, CENTRE))
    known = (f"load.mass={MASS}", f"load.centre=[{place}]", "load.inertia=[0.006,0,0.005,0,0,0.003]")
    found = json.loads((ran(tmp_path, "gains", *given, *known) / "gains.json").read_text())
    error = np.abs(np.array(found["gain"]) - TRUE)
    assert (error < 5 * np.array(found["deviation"]) + 0.01 * TRUE).all()


@pytest.mark.parametrize(("slides", "unit"), [([0, 0], "N·m/A"), ([1, 1], "N/A"), ([0, 1], "N·m/A or N/A")])
def test_gains_have_the_units_of_their_joints(planar, slides, unit):
    found = Gains(np.array([2.0, 3.0]), np.array([0.1, 0.2]), np.zeros(2, bool))
    table = gains_table(replace(planar, prismatic=np.array(slides, bool)), found)
    assert list(table.columns) == [f"gain [{unit}]", "σ"]


SMALL = ("workspace=free", "trajectory.harmonics=3", "controllers.rate=50")
NEXT = ("robot=planar2", "goal.count=2", "trajectory.period=8", *SMALL)


@pytest.fixture(scope="module")
def poor(planar, tmp_path_factory):
    """A recording in which the elbow hardly moves, and the run's folder of the model from it."""
    folder = tmp_path_factory.mktemp("poor")
    whole = moved(planar, np.arange(20 * 100) / 100, 1.0, 0.5, np.random.default_rng(1))
    q, v = (x * np.array([1.0, 0.01]) for x in (whole.position, whole.velocity))
    torque = RigidBody(planar).torque(q, v, np.gradient(v, 0.01, axis=0))
    torque += v + 0.5 * np.tanh(v / 0.03)
    torque += NOISE * np.random.default_rng(2).standard_normal(torque.shape)
    recording = Recording("poor", planar.joint_names, whole.time, q, v, torque=torque)
    frame(recording).to_csv(folder / "poor.csv", index=False)
    return q, ran(folder, "identify", "robot=planar2", f"recordings=[{folder / 'poor.csv'}]")


def test_the_suggested_next_set_moves_the_joint_that_hardly_moved(poor, tmp_path):
    q, known = poor
    report = (known / "report.html").read_text()
    assert "+experiment=excite robot.name=planar2" in report and "known=FOLDER" in report
    folder = ran(tmp_path, "excite", *NEXT, f"known={known}")
    said = r"uncertain by ([\d.]+)% of their usual size, ([\d.]+)% before"
    after, before = map(float, re.search(said, (folder / "set.md").read_text()).groups())
    assert 0 < after < 0.5 * before
    table = pd.read_csv(folder / "trajectories" / "1.csv")
    assert np.ptp(table.q_elbow) > 5 * np.ptp(q[:, 1])


def test_a_known_model_of_another_arm_is_refused(poor, arm, planar, tmp_path):
    text, placed = planar.urdf.read_text(), '<origin xyz="0 0 0.4"/>'  # from shoulder to elbow
    assert placed in text
    (tmp_path / "longer.urdf").write_text(text.replace(placed, '<origin xyz="0 0 0.45"/>', 1))
    longer = load_robot(tmp_path / "longer.urdf")
    for stranger, about in ((longer, "frames"), (arm, "joints shoulder, elbow")):
        with refused(ConfigError, str(poor[1]), about):
            known_model(poor[1], stranger)


def test_a_set_for_a_tool_states_the_expected_deviations(tmp_path):
    wanted = "robot=planar2", "trajectory.period=6", "model=motor_current", "goal.count=1"
    folder = ran(tmp_path, "excite", *wanted, *SMALL, "goal.objective=payload")
    said = (folder / "set.md").read_text()
    assert (
        "a tool is identified to ±" in said and "executed with and without it, given the description" in said
    )
    assert "kg·m² except for my, Ixx, Ixy, Ixz, Iyz, Izz, exe" in said  # an arm in a plane tells no more
    table = pd.read_csv(folder / "goal.csv", index_col=0)
    assert table.index[0] == "tool m" and len(table) == 10
    assert (table["with the set"] <= table["before"]).all()
    assert table["with the set"]["tool m"] < 0.01 * table["before"]["tool m"]
