import dataclasses
import os

import numpy as np
import pandas as pd
import pytest
import torch

from sidegan.errors import ConfigError, RecordingError
from sidegan.recording.load import Source
from sidegan.recording.statistics import statistics_of
from tests.recording.conftest import load_recording, of_file, recorded
from tests.recording.files import frame, write_bag, write_csv, write_mcap, write_npz, write_parquet

KINDS = [write_csv, write_parquet, write_npz, write_bag, write_mcap]


@pytest.fixture
def made(planar, clock):
    return recorded(planar, clock[:200])


@pytest.mark.parametrize("write", KINDS)
def test_what_was_written_is_read(made, tmp_path, write):
    loaded = load_recording(write(made, tmp_path), of_file(), made.joint_names)
    start = 1 if write in (write_bag, write_mcap) else 0  # stamps of zero would mean that there are none
    torch.testing.assert_close(loaded.time, made.time + start, atol=1e-6, rtol=0)
    for name, x in made.signals().items():
        torch.testing.assert_close(loaded.signals()[name], x, atol=1e-12, rtol=0)
    assert loaded.signals().keys() == made.signals().keys()
    assert not loaded.corrupt


@pytest.mark.parametrize("write", KINDS)
def test_pieces_are_the_whole(made, tmp_path, write):
    path = write(made, tmp_path)
    whole = load_recording(path, of_file(), made.joint_names)
    parts = list(Source(path, of_file(), made.joint_names, rows=64))
    assert [len(part) for part in parts] == [64, 64, 64, 8]
    torch.testing.assert_close(torch.cat([part.torque for part in parts]), whole.torque)


def test_a_loose_file_of_a_bag_is_read(made, tmp_path):
    path = next(write_mcap(made, tmp_path).glob("*.mcap")).rename(tmp_path / "alone.mcap")
    assert len(load_recording(path, of_file(), made.joint_names)) == 200


def test_units_become_si(made, tmp_path):
    table = frame(made)
    table["t"] *= 1e3
    table[[c for c in table if c.startswith("q")]] *= 180 / np.pi
    table[["tau1", "tau2"]] *= 1e3
    table.to_csv(tmp_path / "a.csv", index=False)
    units = {"time": "ms", "angle": "deg", "torque": "mNm"}
    loaded = load_recording(tmp_path / "a.csv", of_file(units=units), made.joint_names)
    for name, x in {"time": made.time, **made.signals()}.items():
        torch.testing.assert_close(getattr(loaded, name), x)


def test_joints_are_matched_by_name(made, tmp_path):
    path = write_bag(made, tmp_path, order=[1, 0])
    torch.testing.assert_close(load_recording(path, of_file(), made.joint_names).position, made.position)
    table = frame(made).rename(columns={"q1": "pos.b", "q2": "pos.a"})
    table[table.columns[::-1]].to_csv(tmp_path / "a.csv", index=False)
    columns = of_file(position="pos.{joint}", joints=["b", "a"])
    loaded = load_recording(tmp_path / "a.csv", columns, made.joint_names)
    torch.testing.assert_close(loaded.position, made.position)


def test_arrays_of_all_joints_are_read(made, tmp_path):
    np.savez(tmp_path / "a.npz", t=made.time, q=made.position, tau=made.torque)
    columns = of_file(position="q", torque="tau")
    loaded = load_recording(tmp_path / "a.npz", columns, made.joint_names)
    torch.testing.assert_close(loaded.torque, made.torque)
    with pytest.raises(RecordingError, match="the arm has 3 joints"):
        load_recording(tmp_path / "a.npz", columns, ("a", "b", "c"))


def test_corrupt_rows_are_counted_and_named(made, tmp_path):
    lines = write_csv(made, tmp_path).read_text().splitlines()
    lines[5] = lines[5] + ",7,8"  # two fields too many
    lines[9] = "garbage" + lines[9][lines[9].index(",") :]
    lines[12] = lines[12].rsplit(",", 2)[0]  # two fields short
    lines[20] = lines[20].replace(",", ",nan,", 1).rsplit(",", 1)[0]
    (tmp_path / "a.csv").write_text("\n".join(lines))
    loaded = load_recording(tmp_path / "a.csv", of_file(), made.joint_names)
    assert len(loaded) == 196
    assert sorted(row for row, _ in loaded.corrupt) == [6, 10, 13, 21]
    reasons = dict(loaded.corrupt)
    assert reasons[6] == "9 fields, expected 7"
    assert reasons[10] == "no number in t"
    assert reasons[13] == "no number in tau1, tau2"


def test_a_column_without_numbers_is_refused(made, tmp_path):
    frame(made).assign(tau2=np.nan).to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(RecordingError, match="without a number, in column tau2"):
        load_recording(tmp_path / "a.csv", of_file(), made.joint_names)


@pytest.mark.parametrize(
    ("change", "joints", "message"),
    [
        ({}, 3, r"no position of 1 of the arm's 3 joints: no column 'q3'"),
        ({}, 1, r"has q2: position of more than the arm's 1 joints"),
        ({"tau2": "torque2"}, 2, r"no torque of 1 of the arm's 2 joints: no column 'tau2'"),
        ({"t": "when"}, 2, r"no column 'time' or 't' of time stamps"),
    ],
)
def test_columns_that_do_not_fit_the_arm_are_refused(made, tmp_path, change, joints, message):
    frame(made).rename(columns=change).to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(RecordingError, match=message):
        load_recording(tmp_path / "a.csv", of_file(), tuple("abc"[:joints]))


CONVENTIONS = {
    "as it is excited": ("time", "q_{}", "dq_{}", "tau_{}"),
    "numbered": ("t", "q{}", "qd{}", "tau{}"),
    "with dots": ("time", "position.{}", "velocity.{}", "effort.{}"),
}


@pytest.mark.parametrize("names", CONVENTIONS.values(), ids=CONVENTIONS)
def test_the_usual_names_of_columns_need_no_settings(made, tmp_path, names):
    time, *signals = names
    columns = {time: made.time.numpy()}
    for name, signal in zip(signals, ("position", "velocity", "torque")):
        columns |= {name.format(j): getattr(made, signal)[:, k].numpy() for k, j in enumerate("12")}
    pd.DataFrame(columns).to_csv(tmp_path / "a.csv", index=False)
    loaded = load_recording(tmp_path / "a.csv", of_file(), ("1", "2"))
    for signal in ("time", "position", "velocity", "torque"):
        torch.testing.assert_close(getattr(loaded, signal), getattr(made, signal))


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"time": "t"}, r"has time as 'time' and as 't'; say which is meant: recording.time='time'"),
        (
            {"q_a": "q1", "q_b": "q2"},
            r"has position as 'q_\{joint\}' and as 'q\{index\}'; say which is meant",
        ),
    ],
)
def test_a_signal_that_is_there_twice_is_refused_until_one_is_meant(made, tmp_path, more, message):
    table = frame(made)
    table.assign(**{new: table[old] for new, old in more.items()}).to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(RecordingError, match=message):
        load_recording(tmp_path / "a.csv", of_file(), ("a", "b"))
    meant = of_file(time="t", position="q{index}")
    torch.testing.assert_close(load_recording(tmp_path / "a.csv", meant, ("a", "b")).position, made.position)


def test_a_signal_that_is_not_there_is_left_out(made, tmp_path):
    frame(made).drop(columns=["qd1", "qd2"]).to_csv(tmp_path / "a.csv", index=False)
    assert load_recording(tmp_path / "a.csv", of_file(), made.joint_names).velocity is None


def test_arrays_of_other_lengths_are_refused(made, tmp_path):
    np.savez(tmp_path / "a.npz", t=made.time, q=made.position[:-3], tau=made.torque)
    with pytest.raises(RecordingError, match="not of the same length: t has 200, q has 197"):
        load_recording(tmp_path / "a.npz", of_file(position="q", torque="tau"), made.joint_names)


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.npz", "a.mcap", "a.db3"])
@pytest.mark.parametrize("content", [b"", b"\x93garbage\x00\xff" * 99])
def test_a_file_that_is_none_is_refused(planar, tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=name.replace(".", r"\.")):
        load_recording(tmp_path / name, of_file(), planar.joint_names)


@pytest.mark.parametrize("write", [write_parquet, write_npz, write_mcap, write_bag])
def test_a_truncated_file_is_refused(made, tmp_path, write):
    path = write(made, tmp_path)
    file = path if path.is_file() else max(path.iterdir(), key=lambda p: p.stat().st_size)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 3])
    with pytest.raises(RecordingError):
        load_recording(path, of_file(), made.joint_names)


def test_other_refusals_say_what_was_expected(made, tmp_path):
    joints = made.joint_names
    with pytest.raises(RecordingError, match="there is no recording"):
        load_recording(tmp_path / "none.csv", of_file(), joints)
    (tmp_path / "a.xls").write_text("x")
    with pytest.raises(RecordingError, match=r"ends in \.xls, expected \.csv"):
        load_recording(tmp_path / "a.xls", of_file(), joints)
    (tmp_path / "n.csv").write_text("1,2\n3,4\n")
    with pytest.raises(RecordingError, match="begins with numbers"):
        load_recording(tmp_path / "n.csv", of_file(), joints)
    (tmp_path / "h.csv").write_text("t,q1,q2\n")
    with pytest.raises(RecordingError, match="holds 0 samples, expected 10"):
        statistics_of(Source(tmp_path / "h.csv", of_file(), joints))
    with pytest.raises(RecordingError, match="1 joint names are given, the arm has 2"):
        load_recording(write_csv(made, tmp_path), of_file(joints=["a"]), joints)
    with pytest.raises(ConfigError, match=r"units\.angle is 'turn', expected one of rad, deg"):
        of_file(units={"angle": "turn"})
    with pytest.raises(ConfigError, match="position is None, expected text"):
        of_file(position=None)


def test_bags_without_the_arm_are_refused(made, tmp_path):
    path = write_bag(made, tmp_path, names=["x", "y"])
    with pytest.raises(RecordingError, match=rf"has no joint {', '.join(made.joint_names)}; it has x, y"):
        load_recording(path, of_file(), made.joint_names)
    with pytest.raises(RecordingError, match="has no joint states on /arm, but on /joint_states"):
        load_recording(path, of_file(topic="/arm"), made.joint_names)


def test_a_bag_without_joint_states_is_refused(planar, tmp_path):
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    text = store.types["std_msgs/msg/String"]
    with Writer(tmp_path / "bag", version=9) as writer:
        to = writer.add_connection("/talk", text.__msgtype__, typestore=store)
        writer.write(to, 1, store.serialize_cdr(text("hello"), text.__msgtype__))
    with pytest.raises(RecordingError, match=r"has no joint states .*; it has /talk \(std_msgs/msg/String\)"):
        load_recording(tmp_path / "bag", of_file(), planar.joint_names)


def test_a_bag_with_other_messages_between_is_read(made, tmp_path):
    """A gripper on the same topic, joints in turn, big-endian bytes, and a message that lacks a joint."""
    from rosbags.rosbag2 import Writer
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS2_HUMBLE)
    state, header = store.types["sensor_msgs/msg/JointState"], store.types["std_msgs/msg/Header"]
    stamp = store.types["builtin_interfaces/msg/Time"]
    a, b = made.joint_names
    with Writer(tmp_path / "bag", version=9) as writer:
        to = writer.add_connection("/joint_states", state.__msgtype__, typestore=store)
        for k in range(40):
            names = ([a, b], [b, a, "finger"], ["finger"], [a, b])[k % 4] if k < 36 else [a]
            values = [float(k) if n == a else -float(k) for n in names]
            message = header(stamp(sec=k + 1, nanosec=0), ""), names, *(np.array(values) for _ in range(3))
            raw = store.serialize_cdr(state(*message), state.__msgtype__, little_endian=k % 4 != 3)
            writer.write(to, k + 1, raw)
    for rows in (7, 1000):
        parts = list(Source(tmp_path / "bag", of_file(), made.joint_names, rows=rows))
        position = torch.cat([part.position for part in parts])
        expected = [float(k) for k in range(36) if k % 4 != 2]
        assert position[:, 0].tolist() == expected and (position[:, 1] == -position[:, 0]).all()
        assert torch.cat([part.time for part in parts]).tolist() == [k + 1 for k in expected]
        assert sum(len(part.corrupt) for part in parts) == 4


def test_a_bag_is_walked_through_again(made, tmp_path, monkeypatch):
    path = write_bag(made, tmp_path)
    for most in (800_000_000, 0):
        monkeypatch.setattr("sidegan.recording.load._MOST_KEPT", most)
        source = Source(path, of_file(), made.joint_names, rows=64)
        first, second = (torch.cat([part.torque for part in source]) for _ in range(2))
        torch.testing.assert_close(first, second)
        torch.testing.assert_close(first, made.torque)


def test_a_last_row_that_is_cut_off_is_no_reason_to_refuse(made, tmp_path):
    text = write_csv(made, tmp_path).read_text()
    (tmp_path / "a.csv").write_text(text[:-30])
    loaded = list(Source(tmp_path / "a.csv", of_file(), made.joint_names, rows=199))
    assert sum(map(len, loaded)) == 199
    assert [row for part in loaded for row, _ in part.corrupt] == [201]


def test_a_byte_order_mark_is_no_part_of_a_name(made, tmp_path):
    path = write_csv(made, tmp_path)
    path.write_bytes(path.read_text().encode("utf-8-sig"))
    torch.testing.assert_close(load_recording(path, of_file(), made.joint_names).time, made.time)


def test_half_of_a_complex_number_is_not_dropped(made, tmp_path):
    columns = {name: column.to_numpy() for name, column in frame(made).items()}
    np.savez(tmp_path / "a.npz", **columns | {"q1": columns["q1"] + 1j})
    with pytest.raises(RecordingError, match="array q1 holds complex128, expected real numbers"):
        load_recording(tmp_path / "a.npz", of_file(), made.joint_names)


@pytest.mark.parametrize("pattern", ["q{index}{foo}", "q{index", "q{index:02d}", "{}", "q{0}"])
def test_braces_that_mean_nothing_are_refused(pattern):
    with pytest.raises(ConfigError, match="expected no braces but"):
        of_file(position=pattern)


def test_numbers_that_no_sensor_gives_are_corrupt_rows(made, tmp_path):
    torque = made.torque.clone()
    torque[7, 1] = 1e300
    path = write_csv(dataclasses.replace(made, torque=torque), tmp_path)
    assert load_recording(path, of_file(), made.joint_names).corrupt == ((9, "no number in tau2"),)


def test_what_is_no_file_is_not_waited_for(made, tmp_path):
    os.mkfifo(tmp_path / "a.csv")
    (tmp_path / "folder").mkdir()
    for name, words in (("a.csv", "neither a file nor a folder"), ("folder", "without a bag")):
        with pytest.raises(RecordingError, match=words):
            load_recording(tmp_path / name, of_file(), made.joint_names)


def test_a_file_without_a_clock_is_read_at_a_rate(made, tmp_path):
    table = frame(made).drop(columns="t")
    table.loc[3, "tau1"] = np.nan
    table.to_csv(tmp_path / "a.csv", index=False)
    with pytest.raises(RecordingError, match=r"recording\.rate=1000"):
        load_recording(tmp_path / "a.csv", of_file(), made.joint_names)
    loaded = load_recording(tmp_path / "a.csv", of_file(rate=250.0), made.joint_names)
    times = np.delete(np.arange(200), 3) / 250  # a row that is left out takes its time
    np.testing.assert_allclose(loaded.time - loaded.time[0], times, atol=1e-12)
    assert loaded.corrupt == ((5, "no number in tau1"),)
    table.to_parquet(tmp_path / "a.parquet")
    parts = list(Source(tmp_path / "a.parquet", of_file(rate=250.0), made.joint_names, rows=64))
    time = torch.cat([part.time for part in parts])
    np.testing.assert_allclose(time - time[0], times, atol=1e-12)


def test_a_clock_counts_more_than_a_rate(made, tmp_path):
    loaded = load_recording(write_csv(made, tmp_path), of_file(rate=3.0), made.joint_names)
    torch.testing.assert_close(loaded.time, made.time)


@pytest.mark.parametrize("separator", [",", " ", "\t"])
def test_a_text_without_names_is_read(made, tmp_path, separator):
    frame(made).to_csv(tmp_path / "a.txt", index=False, header=False, sep=separator)
    header = ["t", "q{index}", "qd{index}", "tau{index}"]
    loaded = load_recording(tmp_path / "a.txt", of_file(header=header), made.joint_names)
    for name, x in {"time": made.time, **made.signals()}.items():
        torch.testing.assert_close(getattr(loaded, name), x)
    with pytest.raises(RecordingError, match=r"begins with numbers.*say what they are"):
        load_recording(tmp_path / "a.txt", of_file(), made.joint_names)
    with pytest.raises(RecordingError, match=r"has 7 columns, recording\.header has 5"):
        load_recording(tmp_path / "a.txt", of_file(header=header[:3]), made.joint_names)
    with pytest.raises(RecordingError, match="named twice"):
        load_recording(tmp_path / "a.txt", of_file(header=["t", *["q{index}"] * 3]), made.joint_names)
    with pytest.raises(RecordingError, match=r"leave recording\.header out"):
        load_recording(write_csv(made, tmp_path), of_file(header=header), made.joint_names)
    with pytest.raises(RecordingError, match=r"no recording\.header"):
        load_recording(write_parquet(made, tmp_path), of_file(header=header), made.joint_names)


@pytest.mark.parametrize("names", [True, False])
@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read(made, tmp_path, separator, names):
    """A line of text among them costs no more than itself."""
    lines = frame(made).to_csv(index=False, header=names, sep=separator, decimal=",").splitlines()
    lines[50] = "stopped"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    header = None if names else ["t", "q{index}", "qd{index}", "tau{index}"]
    parts = list(Source(tmp_path / "a.csv", of_file(header=header), made.joint_names, rows=64))
    ((row, _),) = [row for part in parts for row in part.corrupt]
    left_out = row - (2 if names else 1)
    for name, x in {"time": made.time, **made.signals()}.items():
        kept = torch.cat([x[:left_out], x[left_out + 1 :]])
        torch.testing.assert_close(torch.cat([getattr(part, name) for part in parts]), kept)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_a_comma_in_a_name_makes_no_decimal_comma(made, tmp_path, separator):
    frame(made).assign(**{"note 1,5": 1.5}).to_csv(tmp_path / "a.csv", index=False, sep=separator)
    loaded = load_recording(tmp_path / "a.csv", of_file(), made.joint_names)
    torch.testing.assert_close(loaded.torque, made.torque)


def test_a_text_without_names_may_begin_with_what_is_no_number(made, tmp_path):
    """A logger's first row, before its filters are filled."""
    table = frame(made)
    table.loc[0, "tau1"] = np.nan
    table.to_csv(tmp_path / "a.csv", index=False, header=False, na_rep="nan")
    header = ["t", "q{index}", "qd{index}", "tau{index}"]
    loaded = load_recording(tmp_path / "a.csv", of_file(header=header), made.joint_names)
    torch.testing.assert_close(loaded.time, made.time[1:])
    assert loaded.corrupt == ((1, "no number in tau1"),)
