"""Payload, drive gains, and sets designed for what a known model lacks, through their commands."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from sidegan.errors import ConfigError, RecordingError
from sidegan.motion.dynamics import RigidBody
from sidegan.pipeline.known import known_model
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.settings import validate
from sidegan.recording.recording import Recording
from sidegan.robot import load_robot
from tests.identification.test_drive_gains import TRUE
from tests.identification.test_payload import CENTRE, MASS, load, runs  # noqa: F401
from tests.recording.files import frame
from tests.recording.made import moved
from tests.tiny import composed

NOISE = 0.2
WHITE = "goal.correlation=0.005"  # s: at the 100 Hz of the recordings
SAME, ONE_LOUDER = (WHITE, "goal.noise=[0.2,0.2]"), (WHITE, "goal.noise=[0.2,2]")


def ran(outputs, experiment, *overrides):
    """Folder of a run."""
    folder = outputs / "runs" / experiment
    arm = () if any(one.startswith("robot=") for one in overrides) else ("robot=kuka_lwr4",)
    common = (f"+experiment={experiment}", "tracking=off", "parallel.workers=1", f"outputs={outputs}")
    run_stages(validate(composed(*common, *arm, *overrides)), folder, experiment)
    return folder


@pytest.fixture(scope="module")
def files(arm, load, tmp_path_factory):  # noqa: F811
    """Recordings of 20 s at 100 Hz: two without a load, one with it, and currents of both kinds."""
    folder, nothing = tmp_path_factory.mktemp("files"), 0 * load
    for seed, (name, carried) in enumerate({"free": nothing, "again": nothing, "laden": load}.items()):
        data = runs(arm, carried, seed, NOISE, 2000)
        signals = {"position": data.position, "velocity": data.velocity, "torque": data.torque}
        recording = Recording(name, arm.joint_names, torch.arange(2000).double() / 100, **signals)
        frame(recording).to_csv(folder / f"{name}.csv", index=False)
        drives = replace(recording, torque=None, current=data.torque / TRUE)
        frame(drives).to_csv(folder / f"{name}_current.csv", index=False)
    return folder


def test_the_payload_command_tells_mass_and_centre(files, tmp_path, caplog):
    caplog.set_level("INFO", "sidegan")
    folder = ran(tmp_path, "payload", f"recordings=[{files / 'free.csv'}]", f"loaded=[{files / 'laden.csv'}]")
    found = json.loads((folder / "payload.json").read_text())
    assert found["certain"] and found["link"] == "link_7"
    for name, true in zip(("mass", "cx", "cy", "cz"), (MASS, *CENTRE)):
        assert abs(found[name] - true) < 4 * found["deviation"][name] + 5e-3
    assert "Ixx" in (folder / "payload.csv").read_text()
    told = ", ".join(f"{found[x]:.4f} ± {found['deviation'][x]:.1g}" for x in ("cx", "cy", "cz"))
    assert f"centre of mass ({told}) m in the frame of link_7" in caplog.text


def test_the_gains_command_tells_a_setting(files, tmp_path):
    free, laden = (f"[{files / f'{name}_current.csv'}]" for name in ("free", "laden"))
    place = ",".join(map(str, CENTRE))
    known = (f"load.mass={MASS}", f"load.centre=[{place}]", "load.inertia=[0.006,0,0.005,0,0,0.003]")
    folder = ran(tmp_path, "gains", f"recordings={free}", f"loaded={laden}", *known)
    found = json.loads((folder / "gains.json").read_text())
    error = np.abs(np.array(found["gain"]) - TRUE.numpy())
    assert (error < 5 * np.array(found["deviation"]) + 0.01 * TRUE.numpy()).all()


def test_gains_by_a_load_that_was_not_there_are_no_setting(files, tmp_path, caplog):
    free, again = (files / f"{name}_current.csv" for name in ("free", "again"))
    words = f"recordings=[{free}]", f"loaded=[{again}]", "load.mass=1", "load.centre=[0.05,0,0]"
    with pytest.raises(RecordingError, match="the load is not seen in the currents"):
        ran(tmp_path, "gains", *words)
    assert "robot.gains=[" not in caplog.text and not list(tmp_path.rglob("gains.json"))


def test_what_to_do_next_is_a_command_that_designs_for_it(arm, planar, tmp_path):
    """From a recording in which the elbow hardly moves, to trajectories that move it."""
    time = np.arange(20 * 100) / 100
    whole = moved(planar, time, 1.0, 0.5, torch.Generator().manual_seed(1))
    q, v = (x * torch.tensor([1.0, 0.01]) for x in (whole.position, whole.velocity))
    torque = RigidBody(planar).torque(q, v, torch.gradient(v, spacing=0.01, dim=0)[0])
    torque += v + 0.5 * torch.tanh(v / 0.03)
    noisy = torque + 0.2 * torch.randn(torque.shape, generator=torch.Generator().manual_seed(2)).double()
    poor = Recording("poor", planar.joint_names, whole.time, q, v, torque=noisy)
    frame(poor).to_csv(tmp_path / "poor.csv", index=False)
    known = ran(tmp_path, "identify", "robot=planar2", f"recordings=[{tmp_path / 'poor.csv'}]")
    report = (known / "report.html").read_text()
    assert "+experiment=excite robot.name=planar2" in report and "known=FOLDER" in report
    small = "workspace=free", "trajectory.harmonics=3", "trajectory.period=8", "controllers.rate=50"
    words = "robot=planar2", "stages=[excite]", f"known={known}", "selection.count=2", *small
    folder = ran(tmp_path, "excite", *words)
    said = (folder / "set.md").read_text()
    left = float(re.search(r"deviations fall to (\d+)%", said)[1])
    assert 0 < left < 50
    table = pd.read_csv(folder / "trajectories" / "1.csv")
    assert np.ptp(table.q_elbow) > 5 * np.ptp(q[:, 1].numpy())

    other = tmp_path / "longer.urdf"
    text = planar.urdf.read_text()
    assert '<origin xyz="0 0 0.4"/>' in text  # from shoulder to elbow
    other.write_text(text.replace('<origin xyz="0 0 0.4"/>', '<origin xyz="0 0 0.45"/>', 1))
    for path, stranger, said in (
        (known, load_robot(other), "of another arm than planar2: its links are placed otherwise"),
        (known, arm, "is of an arm with joints"),
        (tmp_path, planar, "expected the folder of a run of"),
    ):
        with pytest.raises(ConfigError, match=said):
            known_model(path, stranger)

    def expected(*noise):
        goal = "goal.wanted=all", *noise
        folder = ran(tmp_path, "excite", *words, *goal)
        return pd.read_csv(folder / "goal.csv", index_col=0)["with the set"]

    as_before, alike, louder = expected(), expected(*SAME), expected(*ONE_LOUDER)
    np.testing.assert_allclose(alike, as_before, rtol=0.35)
    rises = louder / alike
    assert (rises[["fv2", "fc2", "fo2"]] > 1.4).all() and (rises[["fc1", "fo1"]] < 1.3).all()


def test_a_set_for_a_tool_says_how_well_it_will_be_told(tmp_path):
    small = ("workspace=free", "trajectory.harmonics=3", "trajectory.period=6", "controllers.rate=50")
    common = ("robot=planar2", "stages=[excite]", "model=motor_current", "selection.count=1", *small)
    folder = ran(tmp_path, "excite", *common, "goal.wanted=payload")
    said = (folder / "set.md").read_text()
    assert "a tool is told to ±" in said and "executed with and without it, beside the description" in said
    assert "kg·m² but for my, Ixx, Ixy, Ixz, Iyz, Izz, exe" in said  # an arm in a plane tells no more
    table = pd.read_csv(folder / "goal.csv", index_col=0)
    assert table.index[0] == "tool m" and len(table) == 10
    assert (table["with the set"] <= table["before"]).all()
    assert table["with the set"]["tool m"] < 0.01 * table["before"]["tool m"]
