"""Files as programs and people write them are read back row by row; oddities are reported."""

import csv
import json
import re
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest
import scipy

from sidegan.errors import RecordingError
from sidegan.recording.check import check_recording
from sidegan.recording.load import load_recording
from sidegan.recording.read import read_and_check
from sidegan.recording.settings import Files
from sidegan.recording.stationary import chain_names, stationary_positions
from sidegan.recording.units import Units
from sidegan.robot import Setup, load_robot
from tests.recording import files
from tests.recording.conftest import of_file, part_of, recorded
from tests.recording.files import frame, written

JOINTS, LEFT, NUMBERS = ("shoulder", "elbow"), ("left_joint_1", "left_joint_2"), ("1", "2")
DEGREES, EPOCH = 180 / np.pi, 1_690_000_000


def table(made, **columns):
    """Time, positions and torques of a recording; columns may be changed, added, or, as None, left out."""
    changed = {**frame(made)[["t", "q1", "q2", "tau1", "tau2"]], **columns}
    return pd.DataFrame({name: x for name, x in changed.items() if x is not None})


def columns_of(pattern):
    return [pattern.format(i=k, n=k + 1, j=joint) for k, joint in enumerate(JOINTS)]


def named(made, time="t", q="q{n}", tau="tau{n}", **more):
    """The table under other names, and with more columns."""
    return table(made).set_axis([time, *columns_of(q), *columns_of(tau)], axis=1).assign(**more)


def read(folder, table, joints=JOINTS, sliding=(), **changes):
    table.to_csv(folder / "a.csv", index=False)
    return load_recording(folder / "a.csv", of_file(**changes), joints, sliding=sliding)


def assert_same(found, made, signals=("position", "torque"), start=0, late=2e-6):
    np.testing.assert_allclose(found.time, made.time + start, atol=late, rtol=0)
    for name in signals:
        np.testing.assert_allclose(found.signals()[name], made.signals()[name], atol=1e-9, rtol=0)


def alone(made, folder):
    """A loose file of a bag."""
    return next(files.write_mcap(made, folder).glob("*.mcap")).rename(folder / "alone.mcap")


def scaled(table):
    """In milliseconds, degrees and N·mm."""
    angles = [c for c in table if c.startswith("q")]
    return table.assign(t=1e3 * table.t, **table[angles] * 180 / np.pi, **1e3 * table[["tau1", "tau2"]])


OTHER = str.maketrans({"1": ".a", "2": ".b"})  # names of joints
ARRAYS = {"position": "q", "velocity": "qd", "torque": "tau"}
WRITTEN = [
    *((write, {}) for write in (files.write_csv, files.write_parquet, alone)),
    (partial(files.write_bag, order=[1, 0]), {}),
    (written(encoding="utf-8-sig"), {}),
    (written(lambda t: t.rename(columns={"q1": "x1", "q2": "x2"})), {"position": "x{joint}"}),
    (written(lambda t: t.rename(columns=lambda c: c.translate(OTHER))), {"joints": ["a", "b"]}),
    (written(scaled), {"units": {"time": "ms", "angle": "deg", "torque": "mNm"}}),
    *((write, ARRAYS) for write in (files.arrays(), files.write_lists)),
    (partial(files.write_lists, names=["a", "b"]), {**ARRAYS, "joints": ["a", "b"]}),
    (files.write_csv, {"rate": 3.0}),  # a clock counts more than a rate
    (written(lambda t: t.assign(time=2 * t.t, q_1=1.0, q_2=2.0)), {"time": "t", "position": "q{index}"}),
    (written(sep=" "), {}),
    # a comma in a name makes no decimal comma
    *((written(lambda t: t.assign(**{"note 1,5": 1.5}), sep=separator), {}) for separator in (";", "\t")),
]


@pytest.mark.parametrize(("write", "changes"), WRITTEN)
def test_every_format_reads_back_what_was_written(made, tmp_path, write, changes):
    path = write(made, tmp_path)
    bag = path.suffix in ("", ".mcap")
    found = load_recording(path, of_file(**changes), made.joint_names if bag else NUMBERS)
    assert found.signals().keys() == made.signals().keys() and not found.corrupt
    assert_same(found, made, made.signals(), start=int(bag))  # stamps of zero would be none


@pytest.mark.parametrize("lag", [0, 2_000_000])
def test_joints_in_separate_messages_are_merged(made, tmp_path, lag):
    """Joint states of two drivers on one topic, the second's at the same stamps or 2 ms later."""
    stamps = (made.time * 1e9).round().astype(int) + 10**9
    messages = [
        (int(t) + lag * k, True, [name], made.position[row, [k]], np.empty(0), made.torque[row, [k]])
        for row, t in enumerate(stamps)
        for k, name in enumerate(made.joint_names)
    ]
    found = load_recording(files.write_messages(tmp_path, messages), of_file(), made.joint_names)
    assert "joints come in separate messages" in found.remarks[0] and found.velocity is None
    again = [np.interp(found.time - 1 - lag * 1e-9 * k, made.time, made.position[:, k]) for k in range(2)]
    np.testing.assert_allclose(found.position, np.transpose(again), atol=1e-4)
    assert len(found) >= len(made) - 1


def at(made):
    """Time stamps of a recording as dates, in whole nanoseconds."""
    return pd.to_datetime((made.time * 1e9).round().astype(np.int64) + EPOCH * 10**9)


def since_1970(made, unit):
    return ((made.time + EPOCH) * unit).round().astype(np.int64)


def headed(made, time, q, tau):
    """Times, angles and torques in milliseconds, degrees and N·mm, under headings that say so."""
    values = made.position * DEGREES, made.torque * 1e3
    columns = {p.format(k + 1): x[:, k] for p, x in zip((q, tau), values) for k in range(2)}
    return pd.DataFrame({time: made.time * 1e3, **columns})


def parquet(table, path):
    table.to_parquet(path / "a.parquet")


def text(table, path, encoding="utf-8", **options):
    table.to_csv(path / "a.csv", **{"index": False, "encoding": encoding, **options})


def lines(made, path):
    """Joint states as they are nested in messages, and a line that was cut off."""
    each = zip(made.time.tolist(), made.position.tolist(), made.torque.tolist())
    said = [
        json.dumps(
            {"stamp": {"sec": 1, "nanosec": round(t * 1e9)}, "name": ["b", "a"], "position": q, "effort": x}
        )
        for t, q, x in each
    ]
    (path / "a.jsonl").write_text("\n".join(said) + '\n{"stamp": {"se')


def echoed(made, path, signals=("position", "velocity", "torque")):
    """What `ros2 topic echo --csv` prints of joint states."""
    values = np.concatenate([getattr(made, name) for name in signals], 1).tolist()
    rows = [[1, round(t * 1e9), "base", *JOINTS, *x] for t, x in zip(made.time.tolist(), values)]
    pd.DataFrame(rows).to_csv(path / "a.csv", index=False, header=False)


def matlab(made, path):
    """A structure of arrays with a row for each joint."""
    log = {"t": made.time, "q": made.position.T, "tau": made.torque.T}
    scipy.io.savemat(path / "a.mat", {"log": log})


def hdf5(name, userblock=0, **arrays):
    """An HDF5 file with these arrays of a recording."""

    def write(made, path):
        h5py = pytest.importorskip("h5py")
        with h5py.File(path / name, "w", userblock_size=userblock) as file:
            for key, of in arrays.items():
                file[key.replace("__", "/")] = of(made)
            file["images/top"] = np.zeros((len(made), 2, 2, 3), np.uint8)
        if userblock:
            content = (path / name).read_bytes()[userblock:]
            (path / name).write_bytes(b"MATLAB 7.3 MAT-file".ljust(userblock) + content)

    return write


def array_of_records(made, path):
    signals = zip(made.time.tolist(), made.position.tolist(), made.torque.tolist())
    (path / "a.json").write_text(json.dumps([dict(zip(("t", "q", "tau"), row)) for row in signals], indent=1))


def object_of_arrays(made, path):
    arrays = {"t": made.time.tolist(), "q": made.position.tolist(), "tau": made.torque.tolist()}
    (path / "a.json").write_text(json.dumps({"log": arrays}))


def only_commanded(made, path):
    named_in_units = {"q_rad": made.position, "qd_rad_s": made.velocity, "tau_cmd_Nm": made.torque}
    np.savez(path / "a.npz", t_s=made.time, **named_in_units)


def also_commanded(made, path):
    np.savez(path / "a.npz", t=made.time, q_rad=made.position, tau_cmd=9 * made.torque, tau_Nm=made.torque)


def units_below(made, path):
    """A row of units below the header."""
    rows = headed(made, "t", "q{}", "tau{}").to_csv(index=False).splitlines()
    (path / "a.csv").write_text("\n".join([rows[0], "[ms],deg,deg,N.mm,N.mm", *rows[1:]]))


def two_arms(made, path):
    other = {f"{name}_right_joint_{k}": 9.0 + k for name in ("q", "tau") for k in (1, 2)}
    names = {f"{name}{k}": f"{name}_left_joint_{k}" for name in ("q", "tau") for k in (1, 2)}
    text(table(made).rename(columns=names).assign(**other), path)


def TORQUE(made):  # noqa: N802
    return made.torque


SPOKEN = ("Time (ms)", "Joint {} Position (deg)", "Joint {} Torque (mNm)")
KINDS = {  # how it is written, its first stamp beyond that of the recording [s], and what is remarked
    "ns since 1970": (lambda m, p: text(table(m, t=since_1970(m, 1e9)), p), EPOCH, "nanoseconds since 1970"),
    "ms since 1970": (lambda m, p: text(table(m, t=since_1970(m, 1e3)), p), EPOCH, "milliseconds since 1970"),
    "ISO": (lambda m, p: text(table(m, t=at(m).astype(str)), p), EPOCH, ""),
    "ISO with a zone": (lambda m, p: text(table(m, t=at(m).tz_localize("UTC").astype(str)), p), EPOCH, ""),
    "ISO with a comma": (
        lambda m, p: text(table(m, t=at(m).astype(str)).map(str).replace(r"\.", ",", regex=True), p, sep=";"),
        EPOCH,
        "",
    ),
    "time of day": (lambda m, p: text(table(m, t=at(m).strftime("%H:%M:%S.%f")), p), EPOCH % 86_400, ""),
    "minutes": (lambda m, p: text(table(m, t=at(m).strftime("%M:%S.%f")), p), EPOCH % 3600, ""),
    "datetime with a zone": (
        lambda m, p: parquet(table(m, t=at(m).tz_localize("UTC").tz_convert("Asia/Tokyo")), p),
        EPOCH,
        "",
    ),
    "datetime index": (lambda m, p: parquet(table(m).set_index("t"), p), 0, ""),
    "index without a name": (lambda m, p: parquet(table(m, t=None).set_index(at(m)), p), EPOCH, ""),
    "units and blanks": (
        lambda m, p: text(headed(m, "Time (ms)", "J{} Pos (deg)", "J{} Torque (N·mm)"), p),
        0,
        "time in ms, position in deg, torque in N·mm, according to the column names",
    ),
    "units": (lambda m, p: text(headed(m, "time_ms", "q{}_deg", "tau_{}_mNm"), p), 0, "position in deg"),
    "UTF-16": (lambda m, p: text(table(m), p, "utf-16", sep="\t"), 0, ""),
    "cp1252": (
        lambda m, p: text(headed(m, "Zeit t [ms]", "Pos {} [°]", "tau{} [mNm]"), p, "cp1252", sep=";"),
        0,
        "position in °",
    ),
    "quotes": (lambda m, p: text(headed(m, *SPOKEN), p, quoting=csv.QUOTE_ALL), 0, "position in deg"),
    "quotes and decimal commas": (
        lambda m, p: text(headed(m, *SPOKEN), p, quoting=csv.QUOTE_ALL, sep=";", decimal=","),
        0,
        "position in deg",
    ),
    "row of units": (
        units_below,
        0,
        "time in ms, position in deg, torque in N.mm, according to the row of units",
    ),
    "echo --csv": (echoed, 1, ""),
    "JSON lines": (lines, 1, ""),
    "MATLAB": (matlab, 0, ""),
    "MATLAB 7.3": (
        hdf5("a.mat", 512, log__t=lambda m: m.time[None], log__q=lambda m: m.position.T, log__tau=TORQUE),
        0,
        "",
    ),
    "HDF5": (
        hdf5("a.h5", t=lambda m: m.time, obs__qpos=lambda m: m.position, obs__effort=TORQUE, action=TORQUE),
        0,
        "",
    ),
    "JSON array": (array_of_records, 0, ""),
    "JSON arrays": (object_of_arrays, 0, ""),
    "commanded torques": (only_commanded, 0, "torques are commanded ones, tau_cmd_Nm, since none are"),
    "commanded and measured torques": (also_commanded, 0, ""),
    "units before numbers": (
        lambda m, p: text(headed(m, "t_ms", "joint_pos_deg_{}", "tau_cmd_mNm_{}"), p),
        0,
        "torques are commanded ones, tau_cmd_mNm_1",
    ),
    "arrays": (lambda m, p: files.arrays(q=m.position.T, pose=np.ones((len(m), 6)))(m, p), 0, ""),
    "two arms": (two_arms, 0, ""),
}


@pytest.mark.parametrize("kind", KINDS)
def test_timestamps_units_and_encodings_are_recognised(made, tmp_path, kind):
    write, start, remark = KINDS[kind]
    write(made, tmp_path)
    (path,), lines = tmp_path.iterdir(), kind == "JSON lines"
    settings = of_file(joints=["b", "a"] if lines else None)
    found = load_recording(path, settings, LEFT if kind == "two arms" else JOINTS)
    assert_same(found, made, start=start, late=1e-3 if "ms " in kind else 2e-6)
    assert remark in "".join(found.remarks) and bool(remark) == bool(found.remarks)
    assert [row for row, _ in found.corrupt] == ([201] if lines else [])


def stacked(time):
    def write(made, folder):
        halves = {"q_rad": made.position, "tau_Nm": made.torque} | ({"t": made.time} if time == "own" else {})
        arrays = {name: np.stack([x[:100], x[100:]]) for name, x in halves.items()}
        np.savez(folder / "a.npz", **arrays | ({"t": made.time[:100]} if time == "shared" else {}))

    return write


def groups(made, folder):
    """As robomimic has them: a group for each episode, which also holds each sample's successor."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(folder / "a.hdf5", "w") as file:
        for k, rows in enumerate((slice(100), slice(100, None))):
            for group in ("obs", "next_obs"):
                here = file.create_group(f"data/demo_{k}/{group}")
                here["robot0_joint_pos"], here["robot0_joint_pos_cos"] = (
                    made.position[rows],
                    made.torque[rows],
                )
                here["robot0_joint_torque"] = made.torque[rows]


EPISODES = [(stacked("own"), None), (stacked("shared"), None), (stacked("none"), 100.0), (groups, 100.0)]


@pytest.mark.parametrize(("write", "rate"), EPISODES)
def test_stacked_episodes_are_read_with_a_gap_between_them(made, tmp_path, write, rate):
    write(made, tmp_path)
    (path,) = tmp_path.iterdir()
    found = load_recording(path, of_file(rate=rate), JOINTS)
    np.testing.assert_allclose(found.position, made.position)
    np.testing.assert_allclose(found.torque, made.torque)
    (gap,) = np.flatnonzero(np.diff(found.time) > 10)
    assert gap == 99


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


@pytest.mark.parametrize("names", NAMES)
def test_columns_are_recognised_by_name(made, tmp_path, names):
    foreign = {c: 1.0 for pattern in FOREIGN.split() for c in columns_of(pattern)}
    found = read(tmp_path, named(made, *names, **foreign))
    assert_same(found, made)
    assert found.velocity is None and found.current is None and not found.remarks


def test_joints_follow_the_order_named_in_the_file(made, tmp_path):
    table = named(made, "Time", "position_{i}", "effort_{i}", name_0="elbow", name_1="shoulder")
    np.testing.assert_allclose(read(tmp_path, table).torque, made.torque[:, [1, 0]])


LEFT_OVER = [
    ("q{i} tau{i}", "q2 tau2", r"counted from 0.* number 1: 'recording.position=\"q\{index\}\"' 'rec"),
    ("q{n} tau{n}", "q3 tau3", "not used: q3, tau3; the arm has 2 joints"),
]


@pytest.mark.parametrize(("names", "more", "words"), LEFT_OVER)
def test_unused_columns_are_reported(made, tmp_path, names, more, words):
    found = read(tmp_path, named(made, "t", *names.split(), **dict.fromkeys(more.split(), 1.0)))
    assert_same(found, made)
    assert re.search(words, "".join(found.remarks))


REFUSED = [
    ({"q": "theta{i}"}, r"fit\? 'recording.position=\"theta\{index0\}\"'"),
    ({"tau": "load{n}"}, r"no torque or current.* fit\? 'recording.torque=\"load\{index\}\"'"),
    ({"q": "{j}x.pos", "tau": "{j}x.tau"}, r"'recording.joints=\[shoulderx, elbowx\]'"),
]


@pytest.mark.parametrize(("names", "words"), REFUSED)
def test_unknown_column_names_are_refused_with_the_setting_to_type(made, tmp_path, names, words):
    with pytest.raises(RecordingError, match=words):
        read(tmp_path, named(made, **names))


def garbled(lines):
    lines[5] = lines[5] + ",7,8"
    lines[8] = lines[8].rsplit(",", 1)[0] + ",1e300"
    lines[9] = "garbage" + lines[9][lines[9].index(",") :]
    lines[12] = lines[12].rsplit(",", 2)[0]
    lines[20] = lines[20].replace(",", ",nan,", 1).rsplit(",", 1)[0]
    lines[-1] = lines[-1][:-30]


GARBLED = {
    6: "9 fields, expected 7",
    9: "in tau2",
    10: "in t",
    13: "in tau1, tau2",
    21: "",
    201: "",
}


def test_corrupt_rows_are_dropped_and_listed(made, tmp_path):
    path = files.write_csv(made, tmp_path)
    lines = path.read_text().splitlines()
    garbled(lines)
    path.write_text("\n".join(lines))
    read = load_recording(path, of_file(), NUMBERS)
    found = dict(read.corrupt)
    assert sorted(found) == sorted(GARBLED) and all(GARBLED[row] in found[row] for row in found)
    kept = [k for k in range(200) if k + 2 not in GARBLED]
    np.testing.assert_allclose(read.time, made.time[kept])


COMMENTS = [("# ", " "), ("# logger v2\n# 7 joints\n", ","), ("% made, by hand\n# ", "\t")]


@pytest.mark.parametrize(("before", "separator"), COMMENTS)
def test_comments_before_the_header_are_skipped(made, tmp_path, before, separator):
    """And the header may be the last of them, as NumPy writes it."""
    text = files.frame(made).to_csv(index=False, sep=separator)
    (tmp_path / "a.txt").write_text(f"{before}{text}")
    found = load_recording(tmp_path / "a.txt", of_file(), NUMBERS)
    assert_same(found, made, made.signals(), late=1e-9)
    assert not found.corrupt


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read(made, tmp_path, separator):
    """A line of text among the numbers costs that line only."""
    lines = files.frame(made).to_csv(index=False, sep=separator, decimal=",").splitlines()
    lines[50] = "stopped"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    found = load_recording(tmp_path / "a.csv", of_file(), NUMBERS)
    ((row, _),) = found.corrupt
    kept = part_of(made, [k for k in range(200) if k != row - 2])
    assert_same(found, kept, kept.signals(), late=1e-9)


@pytest.mark.parametrize("time", ["auto", "none"])
def test_a_file_without_timestamps_is_read_at_a_given_rate(made, tmp_path, time):
    """A dropped row still takes its time; stamps may be ignored."""
    table = files.frame(made).assign(t=0.0).drop(columns=["t"] if time == "auto" else [])
    table.loc[3, "tau1"] = np.nan
    table.to_csv(tmp_path / "a.csv", index=False)
    found = load_recording(tmp_path / "a.csv", of_file(rate=250.0, time=time), NUMBERS)
    np.testing.assert_allclose(found.time - found.time[0], np.delete(np.arange(200), 3) / 250, atol=1e-12)
    assert [reason for _, reason in found.corrupt] == ["no number in tau1"]


def test_a_bag_with_unrelated_messages_is_read(made, tmp_path):
    """A gripper on the same topic, joints in turn, big-endian bytes, and a message that lacks a joint."""
    a, b = made.joint_names
    messages = []
    for k in range(40):
        names = ([a, b], [b, a, "finger"], ["finger"], [a, b])[k % 4] if k < 36 else [a]
        values = np.array([float(k) if n == a else -float(k) for n in names])
        messages.append(((k + 1) * 10**9, k % 4 != 3, names, values, values, values))
    path = files.write_messages(tmp_path, messages)
    found, expected = load_recording(path, of_file(), made.joint_names), [k for k in range(36) if k % 4 != 2]
    assert found.position[:, 0].tolist() == expected
    assert (found.position[:, 1] == -found.position[:, 0]).all()
    assert found.time.tolist() == [k + 1 for k in expected] and len(found.corrupt) == 4


@pytest.fixture
def sliding(planar):
    """The planar arm with a prismatic second joint."""
    lower, upper = np.array([[-2.5, -1.6], [2.5, 1.6]])
    slides = np.array([False, True])
    return replace(planar, prismatic=slides, position_lower=lower, position_upper=upper)


@pytest.mark.parametrize("headings", [("q1", "q2"), ("q1_deg", "q2_mm"), ("J1 Pos (deg)", "J2 Pos (mm)")])
def test_degrees_apply_to_revolute_and_millimetres_to_prismatic_joints(made, tmp_path, headings):
    q = made.position * [DEGREES, 1e3]
    units = {"angle": "deg", "length": "mm"} if headings == ("q1", "q2") else {}
    renamed = table(made, **{"q1": None, "q2": None, **dict(zip(headings, q.T))})
    found = read(tmp_path, renamed, sliding=JOINTS[1:], units=units)
    np.testing.assert_allclose(found.position, made.position)


STATED = [  # a signal, headings of its columns, and the factor to SI units of the unit in them
    ("torque", "tau1 [lbf.ft]; tau1 [ft-lb]; tau1 [lb ft]", 1.3558179483),
    ("torque", "Torque 1 (lbf·in); tau_1_in-lb", 0.1129848290),
    ("torque", "tau1 [oz-in]; tau1 (ozf.in) (filtered)", 0.00706155181423),
    ("torque", "tau1 [N.cm]; tau1_Ncm; tau_Ncm_1; effort[0] (N cm)", 0.01),
    ("torque", "tau1 [kN.m]", 1e3),
    ("torque", "tau1_kgf.cm", 0.0980665),
    ("torque", "tau1 [N*mm]; tau1.N·mm", 1e-3),
    ("torque", "tau1 [Nm] (filtered); tau1 (N·m); tau1 (in); tau1 (MA); tau1 [-]; tau1 [Nm/rad]", 1.0),
    ("torque", "joint_states[0]; effort_lb; tau [left]; tau1 (kg m²); tau (A)", 1.0),
    ("position", "q1 [gon]", np.pi / 200),
    ("position", "q1_mrad; q_mrad_1", 1e-3),
    ("position", "q (rev)", 2 * np.pi),
    ("position", "q1 (measured); position[3]; q (actual); q_min; q [rad]", 1.0),
    ("position", "q_hip_rev; hip_turn.pos; q_wrist_turn", 1.0),
    ("velocity", "qd1 [mrad/s]", 1e-3),
    ("velocity", "qd1 [rev/s]; qd1 [revs/s]", 2 * np.pi),
    ("velocity", "qd1 [rad/s]; qd [rad/s^2]; qd (m); qd_in; qd1 [m/s]", 1.0),
    ("current", "i1 [uA]; i1 [μA]", 1e-6),
    ("current", "current_mA_a", 1e-3),
    ("time", "t [μs]; time_usec", 1e-6),
]


@pytest.mark.parametrize(("signal", "headings", "factor"), STATED)
def test_headings_state_units_and_other_things(signal, headings, factor):
    for heading in headings.split("; "):
        unit, found = Units().of("a.csv", signal, False, heading)
        assert found == pytest.approx(factor, rel=1e-9) and bool(unit) == (factor != 1), heading


@pytest.mark.parametrize(("unit", "factor", "words"), [("m", 1e3, "millimetres"), ("mm", 1e-3, "metres")])
def test_a_prismatic_joint_in_the_wrong_unit_is_refused(sliding, clock, unit, factor, words):
    made = recorded(sliding, clock, ("position", "torque"))
    wrong = replace(made, position=made.position * [1.0, factor])
    assert not any("unit" in warning for warning in check_recording(made, sliding, of_file()).warnings)
    with pytest.raises(RecordingError, match=rf"elbow .*are these {words}\? \(recording\.units\.length="):
        check_recording(wrong, sliding, of_file(units={"length": unit}))


def test_encoder_counts_are_refused_with_the_setting_that_converts_them(recording, planar, tmp_path):
    counts = (recording.position / (2 * np.pi) * 4096 + 2048).round()
    with pytest.raises(RecordingError, match="no unit explains: are these encoder counts") as error:
        check_recording(replace(recording, velocity=None, position=counts), planar, of_file())
    per_turn, zero = map(float, re.findall(r"(?:per_turn|zero): (\d+)", str(error.value)))
    units = {"position": {"per_turn": [per_turn, -per_turn], "zero": zero}}
    columns = dict(zip(("q1", "q2"), counts.T))
    found = read(tmp_path, table(recording, **columns, qd1=1.0, qd2=1.0), units=units)
    np.testing.assert_allclose(found.position, recording.position * [1, -1], atol=np.pi / 4096, rtol=0)
    assert found.velocity is None and "velocity is derived" in found.remarks[0]
    with pytest.raises(RecordingError, match=r"units\.position\.zero has 3 values, the arm has 2"):
        read(tmp_path, table(recording), units={"position": {"per_turn": 4096, "zero": [0, 0, 0]}})


def test_wrapped_revolute_positions_are_unwrapped(recording, tmp_path):
    """Prismatic joints are not unwrapped, nor are degrees, which step by more than 2 pi."""
    far = recording.position * [4.0, 1.0] + np.array([3.0, 0.0])
    wrapped = (far + np.pi) % (2 * np.pi) - np.pi
    columns = dict(zip(("q1", "q2"), wrapped.T))
    found = read(tmp_path, table(recording, **columns))
    turns = (found.position - far) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.broadcast_to(turns[:1].round(), turns.shape), atol=1e-9, rtol=0)
    assert found.remarks[0].startswith("positions of shoulder jump by whole turns")
    slid = read(tmp_path, table(recording, **columns), sliding=JOINTS)
    np.testing.assert_allclose(slid.position, wrapped)
    slow = table(recording, **dict(zip(("q1", "q2"), DEGREES * recording.position.T)))[::10]
    assert not read(tmp_path, slow).remarks


def test_nanoseconds_since_boot_are_not_taken_for_milliseconds_since_1970(made, tmp_path):
    found = read(tmp_path, table(made, t=(made.time * 1e9).round() + 1.5e12))
    assert not found.remarks and np.diff(found.time).mean() > 1e6


def at_rest(made, torque, seconds=4.0):
    """A recording with some time at rest, and torques at will, before it."""
    still = np.arange(0, seconds, 0.01)
    first = {name: float(x) for name, x in table(made).iloc[0].items()}
    held = pd.DataFrame({**first, "t": made.time[0].item() - seconds + still, **torque(still)})
    return pd.concat([held, table(made)], ignore_index=True)


def test_rows_with_the_drives_off_are_dropped(recording, tmp_path):
    found = read(tmp_path, at_rest(recording, lambda _: {"tau1": 0.0, "tau2": 0.0}))
    np.testing.assert_allclose(found.torque, recording.torque)
    assert "no torque changes while the arm rests, as if drives were off: 400 rows" in found.remarks[0]
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
    assert "the torque of a.csv: interpolated at the time stamps of the position" in found.remarks[0]


def test_an_ambiguous_headerless_joint_state_log_is_refused_with_a_header_line(made, tmp_path):
    echoed(made, tmp_path, ("position", "torque"))
    with pytest.raises(RecordingError, match=r"2 values each.* such as stamp\.sec,.*") as error:
        load_recording(tmp_path / "a.csv", of_file(), JOINTS)
    line = str(error.value).partition("such as ")[2]
    (tmp_path / "a.csv").write_text(f"{line}\n{(tmp_path / 'a.csv').read_text()}")
    np.testing.assert_allclose(load_recording(tmp_path / "a.csv", of_file(), JOINTS).torque, made.torque)


def several(folder, made, change=lambda same: same):
    """A file for each signal; that of the torques is changed, and calls them by the joints alone."""
    named(made)[["t", "q1", "q2"]].to_csv(folder / "position.csv", index=False)
    change(named(made, tau="{j}")[["t", *JOINTS]]).to_csv(folder / "effort.csv", index=False)
    files = Files(str(folder / "position.csv"), effort=str(folder / "effort.csv"))
    return load_recording(files, of_file(), JOINTS)


def test_one_file_per_signal_is_merged_into_one_recording(recording, tmp_path):
    assert_same(several(tmp_path, recording), recording)
    found = several(tmp_path, recording, lambda x: x.assign(t=x.t + 3e-4)[100:1900:2].drop(index=[600]))
    # at the stamps of the faster file, where there are torques
    inside = np.isin(recording.time, found.time)
    np.testing.assert_allclose(found.position, recording.position[inside])
    assert np.abs(found.torque - recording.torque[inside]).max() < 0.05 * np.abs(recording.torque).max()
    assert "effort.csv: interpolated" in found.remarks[0] and "is in all files" in found.remarks[1]


APART = [
    ("effort.csv has no column like 't' or 'time'", lambda x: x.drop(columns="t")),
    ("do not overlap in time, .* effort.csv from 100 s", lambda x: x.assign(t=x.t + 100)),
    ("effort.csv has no torque for 1 of the arm's 2 .*without=.elbow", lambda x: x.drop(columns="elbow")),
]


@pytest.mark.parametrize(("words", "change"), APART)
def test_signal_files_that_do_not_match_are_refused(made, tmp_path, words, change):
    with pytest.raises(RecordingError, match=words):
        several(tmp_path, made, change)


def test_a_joint_without_torque_is_locked_at_its_position(recording, tmp_path, planar):
    named(recording).assign(q1=0.3).drop(columns="tau1").to_csv(tmp_path / "a.csv", index=False)
    path, settings = str(tmp_path / "a.csv"), of_file(without=["shoulder"])
    arm = load_robot("planar2", Setup(locked=stationary_positions(planar, [path], settings)))
    (found,) = read_and_check([(path, "training")], arm, settings)
    assert "shoulder is locked and left out, at 0.3" in found.warnings and chain_names(arm) == JOINTS
    np.testing.assert_allclose(found.statistics.signals["position"].upper, recording.position[:, 1:].max(0))
    with pytest.raises(RecordingError, match=r"elbow is left out \(recording\.without\), but moves"):
        stationary_positions(planar, [path], of_file(without=["elbow"]))
