"""What is corrected or merged when a recording is read, with a remark on it."""

import re
from contextlib import nullcontext
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from sidegan.errors import ConfigError, RecordingError
from sidegan.recording.read import read_and_check
from sidegan.recording.settings import Files
from sidegan.recording.stationary import chain_joints, refuse_elsewhere, stationary_positions
from sidegan.robot import Setup, load_robot
from tests.recording.conftest import check, of_file
from tests.recording.files import JOINTS, assert_same, load, named, read, table
from tests.refusals import refused
from tests.robot.urdf import joint, link, more, two_joints

DEGREES = 180 / np.pi


def test_encoder_counts_are_refused_with_the_setting_that_converts_them(recording, tmp_path):
    counts = (recording.position / (2 * np.pi) * 4096 + 2048).round()
    with refused(RecordingError, "recording.units.position") as error:
        check(replace(recording, velocity=None, position=counts))
    per_turn, zero = map(float, re.findall(r"(?:per_turn|zero): (\d+)", str(error.value)))
    units = {"position": {"per_turn": [per_turn, -per_turn], "zero": zero}}
    columns = dict(zip(("q1", "q2"), counts.T))
    found = read(tmp_path, table(recording, **columns, qd1=1.0, qd2=1.0), units=units)
    np.testing.assert_allclose(found.position, recording.position * [1, -1], atol=np.pi / 4096, rtol=0)
    assert found.velocity is None and "velocity is derived" in found.remarks[0]
    with refused(RecordingError, "recording.units.position.zero", "3", "2"):
        read(tmp_path, table(recording), units={"position": {"per_turn": 4096, "zero": [0, 0, 0]}})
    with refused(ConfigError, "position: per_turn", "[4096.0, 0.0]"):
        read(tmp_path, table(recording), units={"position": {"per_turn": [4096, 0]}})


HEADED = [  # headings of time and a position, factors of both, settings, and what the message names
    ("t", "q{} [deg]", 1, 100 * DEGREES, {}, r"per_turn: \[360\d\d, 360\d\d\]"),
    ("t [ms]", "q{}", 1e6, 1, {}, r"recording\.units\.time=us"),
    ("t", "q{}", 1, DEGREES, {"position": {"per_turn": 2 * np.pi}}, r"(?s)^(?!.*units\.angle)"),
]


@pytest.mark.parametrize(("time", "q", "pace", "factor", "units", "words"), HEADED)
def test_a_suggested_unit_takes_the_place_of_that_in_the_headings(
    recording, tmp_path, time, q, pace, factor, units, words
):
    """And of counts, beside which a unit of angles would have no effect."""
    positions = {q.format(j + 1): factor * recording.position[:, j] for j in range(2)}
    changed = {"t": None, "q1": None, "q2": None, time: pace * recording.time, **positions}
    found = read(tmp_path, table(recording, **changed), units=units)
    with refused(RecordingError, "a.csv") as error:
        check(replace(found, name="a.csv"), units=units)
    assert re.search(words, str(error.value)), error.value


def test_wrapped_revolute_positions_are_unwrapped(recording, tmp_path):
    """Prismatic joints are not unwrapped, nor are degrees, which step by more than 2 pi."""
    far = recording.position * [4.0, 1.0] + np.array([3.0, 0.0])
    wrapped = (far + np.pi) % (2 * np.pi) - np.pi
    columns = dict(zip(("q1", "q2"), wrapped.T))
    found = read(tmp_path, table(recording, **columns))
    turns = (found.position - far) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.broadcast_to(turns[:1].round(), turns.shape), atol=1e-9, rtol=0)
    assert "shoulder" in found.remarks[0] and "elbow" not in found.remarks[0]
    slid = read(tmp_path, table(recording, **columns), sliding=JOINTS)
    np.testing.assert_allclose(slid.position, wrapped)
    slow = table(recording, **dict(zip(("q1", "q2"), DEGREES * recording.position.T)))[::10]
    assert not read(tmp_path, slow).remarks


def at_rest(made, torque, seconds=4.0):
    """A recording with some time at rest, and torques at will, before it."""
    still = np.arange(0, seconds, 0.01)
    first = {name: float(x) for name, x in table(made).iloc[0].items()}
    held = pd.DataFrame({**first, "t": made.time[0].item() - seconds + still, **torque(still)})
    return pd.concat([held, table(made)], ignore_index=True)


def test_rows_with_the_drives_off_are_dropped(recording, tmp_path):
    found = read(tmp_path, at_rest(recording, lambda _: {"tau1": 0.0, "tau2": 0.0}))
    np.testing.assert_allclose(found.torque, recording.torque)
    assert "400 rows" in found.remarks[0]
    led = table(recording)
    led.loc[:999, ["tau1", "tau2"]] = 0.0  # somebody moves the arm by hand, drives off
    for other in ("tau1", "tau2"):
        held = read(tmp_path, at_rest(recording, lambda t, j=other: {"tau1": 0.0, "tau2": 0.0, j: np.sin(t)}))
        assert len(held) == 2400 and not held.remarks
    assert len(read(tmp_path, led)) == 2000


def test_signals_logged_on_separate_rows_are_interpolated(recording, tmp_path):
    positions, torques = table(recording, tau1=None, tau2=None), table(recording, q1=None, q2=None)
    later = torques[1::2].assign(t=torques.t[1::2] + 3e-3)
    found = read(tmp_path, pd.concat([positions, later]).sort_values("t"))
    inside = np.isin(recording.time, found.time)
    assert len(found) > 1980 and not found.corrupt
    np.testing.assert_allclose(found.position, recording.position[inside])
    error = np.abs(found.torque - recording.torque[inside]).mean()
    assert error < 0.02 * np.abs(recording.torque).mean()
    assert "the torque of a.csv" in found.remarks[0]


def unchanged(table):
    return table


def several(folder, made, change=unchanged, moved=unchanged):
    """A file for each signal, changed; that of the torques calls them by the joints alone."""
    moved(table(made)[["t", "q1", "q2"]]).to_csv(folder / "position.csv", index=False)
    change(named(made, tau="{j}")[["t", *JOINTS]]).to_csv(folder / "effort.csv", index=False)
    return load(Files(str(folder / "position.csv"), effort=str(folder / "effort.csv")))


def test_one_file_per_signal_is_merged_into_one_recording(recording, tmp_path):
    assert_same(several(tmp_path, recording), recording)
    found = several(tmp_path, recording, lambda x: x.assign(t=x.t + 3e-4)[100:1900:2].drop(index=[600]))
    # at the stamps of the faster file, where there are torques
    inside = np.isin(recording.time, found.time)
    np.testing.assert_allclose(found.position, recording.position[inside])
    assert np.abs(found.torque - recording.torque[inside]).max() < 0.05 * np.abs(recording.torque).max()
    assert "effort.csv" in found.remarks[0] and "is in all files" in found.remarks[1]


APART = {  # what the message names, and changes of the files of torques and positions
    "no stamps": ("effort.csv 't'", lambda x: x.drop(columns="t"), unchanged),
    "another clock": ("position.csv effort.csv 100", lambda x: x.assign(t=x.t + 100), unchanged),
    "a joint": ("effort.csv 'recording.without=[elbow]'", lambda x: x.drop(columns="elbow"), unchanged),
    "a pause": ("position.csv effort.csv", lambda x: x[80:120], lambda x: x.drop(index=range(50, 150))),
}


@pytest.mark.parametrize(("about", "change", "moved"), APART.values(), ids=APART)
def test_signal_files_that_do_not_match_are_refused(made, tmp_path, about, change, moved):
    with refused(RecordingError, *about.split()):
        several(tmp_path, made, change, moved)


def test_a_joint_without_torque_is_locked_at_its_position(recording, tmp_path, planar):
    named(recording).assign(q1=0.3).drop(columns="tau1").to_csv(tmp_path / "a.csv", index=False)
    path, settings = str(tmp_path / "a.csv"), of_file(without=["shoulder"])
    arm = load_robot("planar2", Setup(locked=stationary_positions(planar, [path], settings)))
    (found,) = read_and_check([(path, "training")], arm, settings)
    assert "shoulder is locked and left out, at 0.3" in found.warnings and [*chain_joints(arm)] == [*JOINTS]
    np.testing.assert_allclose(found.statistics.signals["position"].upper, recording.position[:, 1:].max(0))
    with refused(RecordingError, "elbow", "(recording.without)"):
        stationary_positions(planar, [path], of_file(without=["elbow"]))


def test_of_locked_fingers_the_first_belongs_to_the_chain(tmp_path):
    fingers = [f"finger{k}" for k in range(5)]
    parts = [part for name in fingers for part in (link(f"{name}tip"), joint(name, "upper", f"{name}tip"))]
    (tmp_path / "a.urdf").write_text(more(two_joints(), *parts))
    arm = load_robot(str(tmp_path / "a.urdf"), Setup(locked=dict.fromkeys(fingers, 0.1)))
    assert [*chain_joints(arm)] == ["first", "second", "finger0"]


def test_a_locked_rail_may_be_recorded_in_millimetres(recording, tmp_path):
    text = more(two_joints(), link("rail"), joint("slide", "rail", "base", kind="prismatic"))
    (tmp_path / "a.urdf").write_text(text)
    arm = load_robot(str(tmp_path / "a.urdf"), Setup(locked={"slide": 0.3}))
    assert chain_joints(arm) == {"slide": True, "first": False, "second": False}
    columns = {"q_first": "q1", "q_second": "q2", "tau_first": "tau1", "tau_second": "tau2"}
    named = pd.DataFrame({new: table(recording)[old] for new, old in {"t": "t", **columns}.items()})
    for place, elsewhere in ((300.0, False), (350.0, True)):
        named.assign(**{"q_slide [mm]": place}).to_csv(tmp_path / "a.csv", index=False)
        with refused(RecordingError, "slide", "0.3", "0.35") if elsewhere else nullcontext():
            refuse_elsewhere(arm, [str(tmp_path / "a.csv")], of_file())
