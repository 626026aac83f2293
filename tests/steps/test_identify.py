"""A model from recordings, whatever holds them."""

from pathlib import Path

import numpy as np
import pandas as pd
import pytest

import sidegan as sg
from sidegan.errors import InfeasibleError, RecordingError, ShapeError
from tests.refusals import refused
from tests.steps.conftest import SEARCH


@pytest.fixture(scope="module")
def tables(cell, excitation):
    """What the arm with friction of 2 N·m·s/rad would have recorded, a table for each trajectory."""
    random, made = np.random.default_rng(0), []
    for _, part in excitation.to_frame(rate=100).groupby("trajectory"):
        q, dq, ddq = (part.filter(regex=f"^{kind}_").to_numpy() for kind in ("q", "dq", "ddq"))
        tau = cell.torque(q, dq, ddq) + 2 * dq + random.normal(0, 0.1, q.shape)
        torques = dict(zip(("tau_shoulder", "tau_elbow"), tau.T))
        made.append(part[["time", "q_shoulder", "q_elbow"]].assign(**torques))
    return made


@pytest.fixture(scope="module")
def model(cell, tables):
    return sg.identify(cell, tables[:2], validation=tables[2:])


def test_a_model_is_identified_from_tables(cell, excitation, model):
    assert model.verdict in ("good", "usable") and model.errors["nMSE, validation"].max() < 0.01
    friction = model.parameters.set_index("name").value[["fv1", "fv2"]]
    np.testing.assert_allclose(friction, 2, rtol=0.05)
    _, *states = (x[2] for x in excitation.motion())
    np.testing.assert_allclose(model.torque(*states), cell.torque(*states) + 2 * states[1], atol=1)


def test_a_model_from_files_is_the_one_from_tables(cell, tables, model, tmp_path):
    files = [tmp_path / f"{k}.csv" for k in range(3)]
    for table, file in zip(tables, files):
        table.to_csv(file, index=False)
    same = sg.identify(cell, files[:2], validation=files[2:])
    np.testing.assert_allclose(same.parameters.value, model.parameters.value, rtol=1e-6)


def test_times_may_be_an_index_and_signals_may_have_a_table_each(cell, tables, model, caplog):
    indexed = tables[0].set_index(pd.to_timedelta(tables[0].time, "s")).drop(columns="time")
    states, torques = (tables[1].filter(regex=kinds) for kinds in ("time|q_", "time|tau_"))
    last = tables[2].set_index(pd.to_datetime(tables[2].time, unit="s").rename(None))  # beside its time
    with caplog.at_level("INFO"):
        mixed = sg.identify(cell, [indexed, {"position": states, "torque": torques}], validation=[last])
    assert "recording 1: 801" in caplog.text and "recording 2 position and 1 more: 801" in caplog.text
    np.testing.assert_allclose(mixed.parameters.value, model.parameters.value, atol=1e-3)  # rounded times


def test_a_saved_model_has_its_report_and_aims_the_next_set(cell, model, tmp_path):
    model.save(tmp_path)
    assert {"report.html", "verdict.json", "planar2.urdf"} <= {path.name for path in tmp_path.iterdir()}
    assert '\'recordings=["recording 1", "recording 2"]\'' in model.origin.command
    more = sg.excite(cell, 1, known=tmp_path, search=SEARCH, goal={"objective": "parameters"})
    assert more.valid.all()


def test_states_that_do_not_fit_a_model_are_refused(model):
    with refused(ShapeError, "(3,)"):
        model.torque(*np.zeros((3, 3)))
    with refused(ShapeError, "position"):
        model.torque("a", 0, 0)


def test_a_locked_joint_may_move_as_little_as_noise(tables):
    locked = sg.Cell("planar2", locked={"elbow": 0.0})
    with refused(RecordingError, "elbow", "(locked)"):
        sg.identify(locked, tables[0])
    assert sg.identify(locked, tables[0].assign(q_elbow=0.005)).arm.model.joints == 1


def test_messages_about_recordings_suggest_what_python_takes(cell, tables):
    degrees = tables[0].copy()
    degrees[["q_shoulder", "q_elbow"]] *= 180 / np.pi
    with refused(RecordingError, "recording={'units': {'angle': 'deg'}}"):
        sg.identify(cell, degrees)
    given = sg.identify(cell, degrees, recording={"units": {"angle": "deg"}}, gains=[1, 1])
    unused = next(x for x in given.arm.recordings[0].warnings if x.startswith("gains is not used"))
    assert "recording={'torque': None, 'current': 'tau{index}'}" in unused


def test_drive_gains_may_be_an_array(cell, tables, tmp_path):
    currents = tables[0].rename(columns=lambda name: name.replace("tau", "current"))
    made = sg.identify(cell, currents, gains=np.array([1, 1]))
    made.save(tmp_path)
    assert made.origin.settings["robot"]["gains"] == [1, 1] and (tmp_path / "report.html").exists()


def test_a_fit_that_fails_repeats_what_was_found_in_the_recordings(cell, tables, monkeypatch):
    monkeypatch.setattr("sidegan.identification.consistent._OBJECTIVE_SCALES", ())  # nothing can be solved
    against = tables[0].assign(tau_shoulder=-tables[0].tau_shoulder, tau_elbow=-tables[0].tau_elbow)
    with refused(InfeasibleError, "runs against the description"):
        sg.identify(cell, against)


def test_an_arm_with_a_joint_that_stood_still_is_the_one_of_its_cell(planar, tmp_path, monkeypatch):
    """The same file, wherever the process went in between, and the range about the same home."""
    (tmp_path / "away").mkdir()
    monkeypatch.chdir(tmp_path)
    Path("arm.urdf").write_text(planar.urdf.read_text().replace("revolute", "continuous"))
    cell = sg.Cell("arm.urdf", home=[2.0, 0.5], locked=None)
    monkeypatch.chdir("away")
    time = np.arange(0, 10, 0.01)
    table = pd.DataFrame({"t": time, "q1": 2 + np.sin(time), "q2": 0.4, "tau1": np.sin(3 * time)})
    found = sg.check_recordings(cell, table, recording={"without": ["elbow"], "joints": ["1", "2"]}).arm
    assert found.joint_names == ("shoulder",) and found.setup.locked == {"elbow": 0.4}
    np.testing.assert_allclose((found.position_lower + found.position_upper) / 2, [2])
