"""Files of every kind are read as what was written, row by row."""

from functools import partial

import numpy as np
import pytest

from sidegan.recording.load import load_recording
from tests.recording import files
from tests.recording.conftest import of_file, part_of
from tests.recording.files import written

JOINTS = ("1", "2")


def alone(made, folder):
    """A loose file of a bag."""
    return next(files.write_mcap(made, folder).glob("*.mcap")).rename(folder / "alone.mcap")


def scaled(table):
    """In milliseconds, degrees and N·mm."""
    angles = [c for c in table if c.startswith("q")]
    return table.assign(t=1e3 * table.t, **table[angles] * 180 / np.pi, **1e3 * table[["tau1", "tau2"]])


WHOLE = [files.write_csv, files.write_parquet, files.write_bag, files.write_mcap, alone]
OTHER = str.maketrans({"1": ".a", "2": ".b"})  # names of joints
ARRAYS = {"position": "q", "velocity": "qd", "torque": "tau"}
WRITTEN = [
    *((write, {}) for write in WHOLE),
    (partial(files.write_bag, order=[1, 0]), {}),
    (written(encoding="utf-8-sig"), {}),
    (written(lambda t: t.rename(columns={"q1": "x1", "q2": "x2"})), {"position": "x{joint}"}),
    (written(lambda t: t.rename(columns=lambda c: c.translate(OTHER))), {"joints": ["a", "b"]}),
    (written(scaled), {"units": {"time": "ms", "angle": "deg", "torque": "mNm"}}),
    *((write, ARRAYS) for write in (files.arrays(), files.write_lists)),
    (files.write_csv, {"rate": 3.0}),  # a clock counts more than a rate
    (written(lambda t: t.assign(time=2 * t.t, q_1=1.0, q_2=2.0)), {"time": "t", "position": "q{index}"}),
    (written(sep=" "), {}),
    # a comma in a name makes no decimal comma
    *((written(lambda t: t.assign(**{"note 1,5": 1.5}), sep=separator), {}) for separator in (";", "\t")),
]


@pytest.mark.parametrize(("write", "changes"), WRITTEN)
def test_what_was_written_is_read(made, tmp_path, write, changes):
    path = write(made, tmp_path)
    bag = path.suffix in ("", ".mcap")
    joints, start = (made.joint_names, 1) if bag else (JOINTS, 0)  # stamps of zero would be none
    found = load_recording(path, of_file(**changes), joints)
    np.testing.assert_allclose(found.time, made.time + start, atol=1e-6, rtol=0)
    assert found.signals().keys() == made.signals().keys() and not found.corrupt
    for name, x in made.signals().items():
        np.testing.assert_allclose(found.signals()[name], x, atol=1e-12, rtol=0)


def garbled(lines):
    lines[5] = lines[5] + ",7,8"
    lines[8] = lines[8].rsplit(",", 1)[0] + ",1e300"
    lines[9] = "garbage" + lines[9][lines[9].index(",") :]
    lines[12] = lines[12].rsplit(",", 2)[0]
    lines[20] = lines[20].replace(",", ",nan,", 1).rsplit(",", 1)[0]
    lines[-1] = lines[-1][:-30]


GARBLED = {6: "9 fields, expected 7", 9: "in tau2", 10: "in t", 13: "in tau1, tau2", 21: "", 201: ""}


def test_corrupt_rows_are_left_out_and_named(made, tmp_path):
    path = files.write_csv(made, tmp_path)
    lines = path.read_text().splitlines()
    garbled(lines)
    path.write_text("\n".join(lines))
    read = load_recording(path, of_file(), JOINTS)
    found = dict(read.corrupt)
    assert sorted(found) == sorted(GARBLED) and all(GARBLED[row] in found[row] for row in found)
    kept = [k for k in range(200) if k + 2 not in GARBLED]
    np.testing.assert_allclose(read.time, made.time[kept])


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_are_read(made, tmp_path, separator):
    """A line of text among them costs no more than itself."""
    lines = files.frame(made).to_csv(index=False, sep=separator, decimal=",").splitlines()
    lines[50] = "stopped"
    (tmp_path / "a.csv").write_text("\n".join(lines))
    found = load_recording(tmp_path / "a.csv", of_file(), JOINTS)
    ((row, _),) = found.corrupt
    kept = part_of(made, [k for k in range(200) if k != row - 2])
    for name in ("time", *made.signals()):
        np.testing.assert_allclose(getattr(found, name), getattr(kept, name))


def test_a_file_without_a_clock_is_read_at_a_rate(made, tmp_path):
    """A row that is left out takes its time."""
    table = files.frame(made).drop(columns="t")
    table.loc[3, "tau1"] = np.nan
    table.to_csv(tmp_path / "a.csv", index=False)
    found = load_recording(tmp_path / "a.csv", of_file(rate=250.0), JOINTS)
    np.testing.assert_allclose(found.time - found.time[0], np.delete(np.arange(200), 3) / 250, atol=1e-12)
    assert [reason for _, reason in found.corrupt] == ["no number in tau1"]


def test_a_bag_with_other_messages_between_is_read(made, tmp_path):
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
