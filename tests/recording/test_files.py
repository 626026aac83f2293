"""Files as programs write them are read back row by row, whatever their format, encoding and clock."""

import csv
import json
from functools import partial

import numpy as np
import pandas as pd
import pytest
import scipy

from sidegan.errors import RecordingError
from tests.recording import files
from tests.recording.files import JOINTS, assert_same, frame, load, read, table, written
from tests.refusals import refused

DEGREES, EPOCH = 180 / np.pi, 1_690_000_000


def alone(made, folder):
    """A loose file of a bag."""
    return next(files.write_mcap(made, folder).glob("*.mcap")).rename(folder / "alone.mcap")


def scaled(table):
    """In milliseconds, degrees and N·mm."""
    angles = [c for c in table if c.startswith("q")]
    return table.assign(t=1e3 * table.t, **table[angles] * DEGREES, **1e3 * table[["tau1", "tau2"]])


OTHER = str.maketrans({"1": ".a", "2": ".b"})  # names of joints
NUMBERED = {"joints": ["1", "2"]}
ARRAYS = {"position": "q", "velocity": "qd", "torque": "tau"}
WRITTEN = [
    *((write, {}) for write in (files.write_csv, files.write_parquet, alone)),
    (partial(files.write_bag, order=[1, 0]), {}),
    (written(encoding="utf-8-sig"), {}),
    (written(lambda t: t.rename(columns={"q1": "x1", "q2": "x2"})), {**NUMBERED, "position": "x{joint}"}),
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
    found = load(path, **changes)
    assert found.signals().keys() == made.signals().keys() and not found.corrupt
    bag = path.suffix in ("", ".mcap")  # whose stamps begin at a second: those of zero would be none
    assert_same(found, made, made.signals(), start=int(bag), late=2e-6 if bag else 1e-9)


def matlab(made, path):
    """A structure of arrays with a row for each joint."""
    log = {"t": made.time, "q": made.position.T, "tau": made.torque.T}
    scipy.io.savemat(path / "a.mat", {"log": log})


def write_hdf5(path, userblock=0, **arrays):
    """An HDF5 file of arrays, and images; after 512 bytes, those of MATLAB 7.3."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=userblock) as file:
        for name, x in arrays.items():
            file[name.replace("__", "/")] = x
        file["images/top"] = np.zeros((len(x), 2, 2, 3), np.uint8)
    if userblock:
        content = path.read_bytes()[userblock:]
        path.write_bytes(b"MATLAB 7.3 MAT-file".ljust(userblock) + content)


def matlab73(made, path):
    q, tau = made.position.T, made.torque.T
    write_hdf5(path / "a.mat", 512, log__t=made.time[None], log__q=q, log__tau=tau)


def hdf5(made, path):
    obs = {"obs__qpos": made.position, "obs__effort": made.torque, "action": made.torque}
    write_hdf5(path / "a.h5", t=made.time, **obs)


def json_array(made, path):
    """An object for each row."""
    signals = zip(made.time.tolist(), made.position.tolist(), made.torque.tolist())
    (path / "a.json").write_text(json.dumps([dict(zip(("t", "q", "tau"), row)) for row in signals], indent=1))


def json_arrays(made, path):
    arrays = {"t": made.time.tolist(), "q": made.position.tolist(), "tau": made.torque.tolist()}
    (path / "a.json").write_text(json.dumps({"log": arrays}))


def wide_arrays(made, path):
    files.arrays(q=made.position.T, pose=np.ones((len(made), 6)))(made, path)


def measured_arrays(made, path):
    """Beside commanded torques, which are not read then."""
    np.savez(path / "a.npz", t=made.time, q_rad=made.position, tau_cmd=9 * made.torque, tau_Nm=made.torque)


@pytest.mark.parametrize(
    "write", [matlab, matlab73, hdf5, json_array, json_arrays, wide_arrays, measured_arrays]
)
def test_arrays_are_read(made, tmp_path, write):
    write(made, tmp_path)
    (path,) = tmp_path.iterdir()
    found = load(path)
    assert_same(found, made)
    assert not found.remarks and not found.corrupt


@pytest.mark.parametrize(("name", "load_of"), [("tau_cmd_Nm", "torque"), ("i_cmd_A", "current")])
def test_commanded_torques_are_read_if_none_are_measured(made, tmp_path, name, load_of):
    named_in_units = {"q_rad": made.position, "qd_rad_s": made.velocity, name: made.torque}
    np.savez(tmp_path / "a.npz", t_s=made.time, **named_in_units)
    found = load(tmp_path / "a.npz")
    assert_same(found, made, ("position", "velocity"))
    np.testing.assert_allclose(getattr(found, load_of), made.torque)
    assert load_of in found.remarks[0] and name in found.remarks[0]


def echo(made, path, signals=("position", "velocity", "torque")):
    """What `ros2 topic echo --csv` prints of joint states."""
    values = np.concatenate([getattr(made, name) for name in signals], 1).tolist()
    rows = [[1, round(t * 1e9), "base", *JOINTS, *x] for t, x in zip(made.time.tolist(), values)]
    pd.DataFrame(rows).to_csv(path, index=False, header=False)


def test_a_printed_joint_state_needs_no_header_unless_it_is_ambiguous(made, tmp_path):
    """The message has the header line that makes it readable."""
    path = tmp_path / "a.csv"
    echo(made, path)
    assert_same(load(path), made, made.signals(), start=1)
    echo(made, path, ("position", "torque"))
    with refused(RecordingError, "stamp.sec,") as error:
        load(path)
    path.write_text(f"{str(error.value).partition('such as ')[2]}\n{path.read_text()}")
    np.testing.assert_allclose(load(path).torque, made.torque)


@pytest.mark.parametrize("parts", [("sec", "nanosec"), ("seconds", "nanoseconds"), ("nanosec", "sec")])
def test_lines_of_nested_objects_are_read_but_for_one_that_was_cut_off(made, tmp_path, parts):
    said = []
    for t, q, tau in zip(made.time.tolist(), made.position.tolist(), made.torque.tolist()):
        stamp = {part: round(t * 1e9) if "nano" in part else 1 for part in parts}
        said.append(json.dumps({"stamp": stamp, "name": ["b", "a"], "position": q, "effort": tau}))
    (tmp_path / "a.jsonl").write_text("\n".join(said) + '\n{"stamp": {"se')
    found = load(tmp_path / "a.jsonl", joints=["b", "a"])
    assert_same(found, made, start=1)
    assert [row for row, _ in found.corrupt] == [201]


def dates(made):
    """Time stamps of a recording as dates, in whole nanoseconds."""
    return pd.to_datetime((made.time * 1e9).round().astype(np.int64) + EPOCH * 10**9)


def since_1970(made, unit):
    return ((made.time + EPOCH) * unit).round().astype(np.int64)


STAMPS = {  # a column of time stamps, and the first of them [s]
    "nanoseconds": (lambda m: since_1970(m, 1e9), EPOCH),
    "milliseconds": (lambda m: since_1970(m, 1e3), EPOCH),
    "ISO": (lambda m: dates(m).astype(str), EPOCH),
    "ISO with a zone": (lambda m: dates(m).tz_localize("UTC").astype(str), EPOCH),
    "ISO with a comma": (lambda m: dates(m).astype(str).str.replace(".", ","), EPOCH),
    "time of day": (lambda m: dates(m).strftime("%H:%M:%S.%f"), EPOCH % 86_400),
    "minutes": (lambda m: dates(m).strftime("%M:%S.%f"), EPOCH % 3600),
    "dates with a zone": (lambda m: dates(m).tz_localize("UTC").tz_convert("Asia/Tokyo"), EPOCH),
}


@pytest.mark.parametrize("kind", STAMPS)
@pytest.mark.parametrize("write", [partial(pd.DataFrame.to_csv, sep=";"), pd.DataFrame.to_parquet])
def test_time_stamps_are_recognised(made, tmp_path, kind, write):
    stamps, start = STAMPS[kind]
    path = tmp_path / ("a.csv" if isinstance(write, partial) else "a.parquet")
    write(table(made, t=stamps(made)), path, index=False)
    found = load(path)
    assert_same(found, made, start=start, late=1e-3 if kind == "milliseconds" else 2e-6)
    assert "".join(found.remarks).startswith(f"time stamps are {kind} since 1970") == kind.endswith("seconds")


def test_unsigned_stamps_of_an_hdf5_file_are_read(made, tmp_path):
    stamps = since_1970(made, 1e9).astype(np.uint64)
    write_hdf5(tmp_path / "a.h5", t=stamps, q=made.position, tau=made.torque)
    assert_same(load(tmp_path / "a.h5"), made, start=EPOCH)


@pytest.mark.parametrize("named", [True, False])
def test_an_index_holds_the_time_stamps(made, tmp_path, named):
    indexed = table(made).set_index("t") if named else table(made, t=None).set_index(dates(made))
    indexed.to_parquet(tmp_path / "a.parquet")
    found = load(tmp_path / "a.parquet")
    assert_same(found, made, start=0 if named else EPOCH)


def test_nanoseconds_since_boot_are_not_taken_for_milliseconds_since_1970(made, tmp_path):
    found = read(tmp_path, table(made, t=(made.time * 1e9).round() + 1.5e12))
    assert not found.remarks and np.diff(found.time).mean() > 1e6


SPOKEN = "Time (ms)", "Joint {} Position (deg)", "Joint {} Torque (mNm)"
QUOTED = {"quoting": csv.QUOTE_ALL}
HEADED = [  # headings of time, angles and torques in milliseconds, degrees and N·mm, and how they are written
    (("Time (ms)", "J{} Pos (deg)", "J{} Torque (N·mm)"), {}),
    (("time_ms", "q{}_deg", "tau_{}_mNm"), {}),
    (("t_ms", "joint_pos_deg_{}", "tau_cmd_mNm_{}"), {"encoding": "utf-16", "sep": "\t"}),
    (("Zeit t [ms]", "Pos {} [°]", "tau{} [mNm]"), {"encoding": "cp1252", "sep": ";"}),
    *((SPOKEN, form) for form in (QUOTED, {**QUOTED, "sep": ";", "decimal": ","})),
    (("t", "q{}", "tau{}"), "[ms],deg,deg,N.mm,N.mm"),  # in a row below
]


@pytest.mark.parametrize(("headings", "form"), HEADED)
def test_units_encodings_and_separators_are_recognised(made, tmp_path, headings, form):
    time, q, tau = headings
    signals = {q: made.position * DEGREES, tau: made.torque * 1e3}
    columns = {pattern.format(k + 1): x[:, k] for pattern, x in signals.items() for k in range(2)}
    whole, units = pd.DataFrame({time: made.time * 1e3, **columns}), form if isinstance(form, str) else ""
    whole.to_csv(tmp_path / "a.csv", index=False, **({} if units else form))
    if units:
        lines = (tmp_path / "a.csv").read_text().split("\n")
        (tmp_path / "a.csv").write_text("\n".join([lines[0], units, *lines[1:]]))
    found = load(tmp_path / "a.csv")
    assert_same(found, made)
    remarks = "; ".join(found.remarks)
    assert all(f"{name} in " in remarks for name in ("time", "position", "torque"))
    assert ("tau_cmd_mNm_1" in remarks) == ("cmd" in tau)  # commanded torques, since none are measured


def stacked(time):
    def write(made, folder):
        halves = {"q_rad": made.position, "tau_Nm": made.torque} | ({"t": made.time} if time == "own" else {})
        arrays = {name: np.stack([x[:100], x[100:]]) for name, x in halves.items()}
        np.savez(folder / "a.npz", **arrays | ({"t": made.time[:100]} if time == "shared" else {}))

    return write


def groups(made, folder):
    """As robomimic has them: a group for each episode, which also holds each sample's successor."""
    arrays = {}
    for k, rows in enumerate((slice(100), slice(100, None))):
        for group in ("obs", "next_obs"):
            here = f"data__demo_{k}__{group}__robot0_joint"
            arrays |= {f"{here}_pos": made.position[rows], f"{here}_pos_cos": made.torque[rows]}
            arrays[f"{here}_torque"] = made.torque[rows]
    write_hdf5(folder / "a.hdf5", **arrays)


EPISODES = [(stacked("own"), None), (stacked("shared"), None), (stacked("none"), 100.0), (groups, 100.0)]


@pytest.mark.parametrize(("write", "rate"), EPISODES)
def test_stacked_episodes_are_read_with_a_gap_between_them(made, tmp_path, write, rate):
    write(made, tmp_path)
    (path,) = tmp_path.iterdir()
    found = load(path, rate=rate)
    np.testing.assert_allclose(found.position, made.position)
    np.testing.assert_allclose(found.torque, made.torque)
    (gap,) = np.flatnonzero(np.diff(found.time) > 10)
    assert gap == 99


def garble(lines):
    lines[5] = lines[5] + ",7,8"
    lines[8] = lines[8].rsplit(",", 1)[0] + ",1e300"
    lines[9] = "garbage" + lines[9][lines[9].index(",") :]
    lines[12] = lines[12].rsplit(",", 2)[0]
    lines[20] = lines[20].replace(",", ",nan,", 1).rsplit(",", 1)[0]
    lines[-1] = lines[-1][:-30]


GARBLED = {6: "9 fields", 9: "tau2", 10: "t", 13: "tau1, tau2", 21: "", 201: ""}  # rows, and what is wrong


def test_corrupt_rows_are_dropped_and_listed(made, tmp_path):
    path = files.write_csv(made, tmp_path)
    lines = path.read_text().splitlines()
    garble(lines)
    path.write_text("\n".join(lines))
    found = load(path)
    reasons = dict(found.corrupt)
    assert sorted(reasons) == sorted(GARBLED) and all(GARBLED[row] in reasons[row] for row in reasons)
    kept = [k for k in range(200) if k + 2 not in GARBLED]
    np.testing.assert_allclose(found.time, made.time[kept])


@pytest.mark.parametrize(
    ("before", "separator"), [("# ", " "), ("# logger v2\n# 7 joints\n", ","), ("% made, by hand\n# ", "\t")]
)
def test_comments_before_the_header_are_skipped(made, tmp_path, before, separator):
    """And the header may be the last of them, as NumPy writes it."""
    (tmp_path / "a.txt").write_text(before + frame(made).to_csv(index=False, sep=separator))
    found = load(tmp_path / "a.txt")
    assert_same(found, made, made.signals(), late=1e-9)
    assert not found.corrupt


@pytest.mark.parametrize("end", ["", " "])
@pytest.mark.parametrize("form", ["%12.6f", "%.6f "])
def test_columns_may_be_aligned_by_blanks(made, tmp_path, form, end):
    header = " ".join(f"{name:>12}" for name in table(made))
    np.savetxt(tmp_path / "a.txt", table(made), form, header=header + end, newline=end + "\n")
    found = load(tmp_path / "a.txt")
    np.testing.assert_allclose(found.torque, made.torque, atol=1e-6)
    assert not found.corrupt


def test_a_blank_field_between_single_blanks_stays_in_its_column(made, tmp_path):
    blank = table(made, qd1=made.velocity[:, 0], qd2=made.velocity[:, 1])
    blank.loc[3, "q1"] = np.nan
    blank.to_csv(tmp_path / "a.txt", sep=" ", index=False)
    found = load(tmp_path / "a.txt")
    np.testing.assert_allclose(found.torque, np.delete(made.torque, 3, 0))
    assert [row for row, _ in found.corrupt] == [5]


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read(made, tmp_path, separator):
    """A line of text among the numbers costs that line only."""
    lines = frame(made).to_csv(index=False, sep=separator, decimal=",").splitlines()
    lines[50] = "stopped"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    found = load(tmp_path / "a.csv")
    ((row, _),) = found.corrupt
    kept = made.take([k for k in range(200) if k != row - 2])
    assert_same(found, kept, kept.signals(), late=1e-9)


@pytest.mark.parametrize("time", ["auto", "none"])
def test_a_file_without_timestamps_is_read_at_a_given_rate(made, tmp_path, time):
    """A dropped row still takes its time; stamps may be ignored."""
    table = frame(made).assign(t=0.0).drop(columns=["t"] if time == "auto" else [])
    table.loc[3, "tau1"] = np.nan
    found = read(tmp_path, table, rate=250.0, time=time)
    np.testing.assert_allclose(found.time - found.time[0], np.delete(np.arange(200), 3) / 250, atol=1e-12)
    assert len(found.corrupt) == 1 and "tau1" in found.corrupt[0][1]


def test_signals_of_a_bag_that_are_not_wanted_are_not_read(made, tmp_path):
    bag = files.write_bag(made, tmp_path)
    assert [*load(bag, torque=None).signals()] == ["position", "velocity"]
    assert [*load(bag, velocity=None).signals()] == ["position", "torque"]


@pytest.mark.parametrize("lag", [0, 2_000_000])
def test_joints_in_separate_messages_are_merged(made, tmp_path, lag):
    """Joint states of two drivers on one topic, the second's at the same stamps or 2 ms later."""
    stamps = (made.time * 1e9).round().astype(int) + 10**9
    messages = [
        (int(t) + lag * k, True, [name], made.position[row, [k]], np.empty(0), made.torque[row, [k]])
        for row, t in enumerate(stamps)
        for k, name in enumerate(made.joint_names)
    ]
    found = load(files.write_messages(tmp_path, messages))
    assert "shoulder; elbow" in found.remarks[0] and found.velocity is None
    again = [np.interp(found.time - 1 - lag * 1e-9 * k, made.time, made.position[:, k]) for k in range(2)]
    np.testing.assert_allclose(found.position, np.transpose(again), atol=1e-4)
    assert len(found) >= len(made) - 1


def test_velocities_of_a_bag_are_left_out_by_the_setting_that_derives_them(made, tmp_path):
    found = load(files.write_bag(made, tmp_path), velocity=None)
    assert found.signals().keys() == {"position", "torque"}


def test_a_bag_with_unrelated_messages_is_read(made, tmp_path):
    """A gripper on the same topic, joints in turn, big-endian bytes, and a message that lacks a joint."""
    a, b = made.joint_names
    messages = []
    for k in range(40):
        names = ([a, b], [b, a, "finger"], ["finger"], [a, b])[k % 4] if k < 36 else [a]
        values = np.array([float(k) if n == a else -float(k) for n in names])
        messages.append(((k + 1) * 10**9, k % 4 != 3, names, values, values, values))
    path = files.write_messages(tmp_path, messages)
    found, expected = load(path), [k for k in range(36) if k % 4 != 2]
    assert found.position[:, 0].tolist() == expected
    assert (found.position[:, 1] == -found.position[:, 0]).all()
    assert found.time.tolist() == [k + 1 for k in expected] and len(found.corrupt) == 4
