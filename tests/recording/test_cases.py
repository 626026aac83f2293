"""Files as people have them: columns by many names, a file for each signal, a joint without a torque."""

import re

import numpy as np
import pytest

from sidegan.errors import RecordingError
from sidegan.recording.check import read_and_check
from sidegan.recording.load import load_recording
from sidegan.recording.settings import Files
from sidegan.recording.stationary import chain_of, stationary_positions
from sidegan.robot import Setup, load_robot
from tests.recording.conftest import of_file
from tests.recording.files import frame

JOINTS = ("shoulder", "elbow")
NAMES = [  # of time, positions and torques; {i} counts from 0, {n} from 1
    *(("t", "q{i}", "tau{i}"), ("Time", "Q{n}", "TAU{n}"), ("time [s]", "q_{i}", "tau_{i}")),
    *(("timestamp", "joint_{i}_pos", "joint_{i}_torque"), ("t", "actual_q_{i}", "motor_torque_{i}")),
    *(("t", "- {j}_position", "- {j}_effort"), (" t", " q0{n}", " tau0{n}"), ("t", "{j}.pos", "effort.{j}")),
    *(("state.time", "state.q[{i}]", "state.tau_J[{i}]"), ("%time", "field.pos{i}", "field.eff{i}")),
    *(("__time", "/states/{j}/position", "/states/{j}/effort"), ("t", "current_pos_{i}", "motorTrq{i}")),
    *(("time", ".position.{i}", ".effort.{i}"), ("timestamp", "observation.state.{j}.pos", "{j}.effort")),
]
FOREIGN = """q_d[{i}] tau_J_d[{i}] tau_ext_hat_filtered[{i}] target_q_{i} tau_dot_{n} O_T_EE[{i}] theta[{i}]
action.{j}.pos finger_joint{n}_position actual_TCP_speed_{i}"""


def columns_of(pattern):
    return [pattern.format(i=k, n=k + 1, j=joint) for k, joint in enumerate(JOINTS)]


def named(made, time="t", q="q{n}", tau="tau{n}", **more):
    """The table of a recording's time, positions and torques under other names, and of more columns."""
    table = frame(made)[["t", "q1", "q2", "tau1", "tau2"]]
    return table.set_axis([time, *columns_of(q), *columns_of(tau)], axis=1).assign(**more)


def read(folder, table):
    table.to_csv(folder / "a.csv", index=False)
    return load_recording(folder / "a.csv", of_file(), JOINTS)


def assert_same(found, made):
    for name in ("time", "position", "torque"):
        np.testing.assert_allclose(getattr(found, name), getattr(made, name))


@pytest.mark.parametrize("names", NAMES)
def test_columns_are_known_by_their_names(made, tmp_path, names):
    foreign = {c: 1.0 for one in FOREIGN.split() for c in columns_of(one)}
    found = read(tmp_path, named(made, *names, **foreign))
    assert_same(found, made)
    assert found.velocity is None and found.current is None and not found.remarks


def test_joints_are_in_the_order_that_the_file_names(made, tmp_path):
    table = named(made, "Time", "position_{i}", "effort_{i}", name_0="elbow", name_1="shoulder")
    np.testing.assert_allclose(read(tmp_path, table).torque, made.torque[:, [1, 0]])


LEFT = [
    ("q{i} tau{i}", "q2 tau2", r"counted from 0.* say so: 'recording.position=\"q\{index\}\"' 'rec"),
    ("q{n} tau{n}", "q3 tau3", "left over: q3, tau3; the arm has 2 joints"),
]


@pytest.mark.parametrize(("names", "more", "words"), LEFT)
def test_a_column_that_is_left_over_is_remarked_on(made, tmp_path, names, more, words):
    found = read(tmp_path, named(made, "t", *names.split(), **dict.fromkeys(more.split(), 1.0)))
    assert_same(found, made)
    assert re.search(words, "".join(found.remarks))


REFUSED = [
    ({"q": "theta{i}"}, r"fit\? 'recording.position=\"theta\{index0\}\"'"),
    ({"tau": "load{n}"}, r"neither torque nor current.* fit\? 'recording.torque=\"load\{index\}\"'"),
    ({"q": "{j}x.pos", "tau": "{j}x.tau"}, r"'recording.joints=\[shoulderx,elbowx\]'"),
]


@pytest.mark.parametrize(("names", "words"), REFUSED)
def test_unknown_column_names_are_refused_with_the_setting_to_type(made, tmp_path, names, words):
    with pytest.raises(RecordingError, match=words):
        read(tmp_path, named(made, **names))


def several(folder, made, change=lambda same: same):
    """A file for each signal; that of the torques is changed, and calls them by the joints alone."""
    named(made)[["t", "q1", "q2"]].to_csv(folder / "position.csv", index=False)
    change(named(made, tau="{j}")[["t", *JOINTS]]).to_csv(folder / "effort.csv", index=False)
    files = Files(str(folder / "position.csv"), effort=str(folder / "effort.csv"))
    return load_recording(files, of_file(), JOINTS)


def test_a_file_for_each_signal_is_one_recording(recording, tmp_path):
    assert_same(several(tmp_path, recording), recording)
    found = several(tmp_path, recording, lambda x: x.assign(t=x.t + 3e-4)[100:1900:2].drop(index=[600]))
    # at the stamps of the faster file, where there are torques
    inside = np.isin(recording.time, found.time)
    np.testing.assert_allclose(found.position, recording.position[inside])
    assert np.abs(found.torque - recording.torque[inside]).max() < 0.05 * np.abs(recording.torque).max()
    assert "effort.csv: interpolated" in found.remarks[0] and "is in all files" in found.remarks[1]


APART = [
    ("effort.csv has no column like 't' or 'time'", lambda x: x.drop(columns="t")),
    ("no moment is in all files, .* effort.csv from 100 s", lambda x: x.assign(t=x.t + 100)),
    ("effort.csv has no torque of 1 of the arm's 2 .*without=.elbow", lambda x: x.drop(columns="elbow")),
]


@pytest.mark.parametrize(("words", "change"), APART)
def test_files_that_do_not_go_together_are_refused(made, tmp_path, words, change):
    with pytest.raises(RecordingError, match=words):
        several(tmp_path, made, change)


def test_a_joint_without_a_torque_is_locked_where_it_stands(recording, tmp_path, planar):
    named(recording).assign(q1=0.3).drop(columns="tau1").to_csv(tmp_path / "a.csv", index=False)
    path, settings = str(tmp_path / "a.csv"), of_file(without=["shoulder"])
    arm = load_robot("planar2", Setup(locked=stationary_positions(planar, [path], settings)))
    (found,) = read_and_check([(path, "training")], arm, settings)
    assert "shoulder is left out, locked at 0.3" in found.warnings and chain_of(arm) == JOINTS
    np.testing.assert_allclose(found.statistics.signals["position"].upper, recording.position[:, 1:].max(0))
    with pytest.raises(RecordingError, match=r"elbow, which recording\.without leaves out, moves"):
        stationary_positions(planar, [path], of_file(without=["elbow"]))
