"""Settings, files and recordings that are refused or warned about, with the message."""

import math
import os
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest

from sidegan.errors import ConfigError, RecordingError
from sidegan.recording.check import check_recording
from sidegan.recording.load import load_recording
from sidegan.recording.settings import Files
from sidegan.robot import load_robot
from tests.recording import files
from tests.recording.conftest import of_file, part_of

PLANAR = load_robot("planar2")
SETTINGS = [
    (r"units\.angle is 'turn', expected 'rad' or 'deg'", {"units": {"angle": "turn"}}),
    ("position is None, expected text", {"position": None}),
    *(("in braces", {"position": x}) for x in ("q{index}{foo}", "q{index", "q{index:02d}", "{}", "q{0}")),
    *((name, {name: -1.0}) for name in ("cutoff", "still")),
    *(("cutoff", {"cutoff": 0}), ("gap", {"gap": 1e300})),
]


@pytest.mark.parametrize(("words", "changes"), SETTINGS)
def test_invalid_settings_are_refused(words, changes):
    with pytest.raises(ConfigError, match=words):
        of_file(**changes)


def of_text(_, folder):
    return files.write_messages(folder, [(1, True, "hello")], "std_msgs/msg/String")


bag = partial(files.write_bag, names=["1", "2"])


def of_words(text):
    def write(_, folder):
        (folder / "a.txt").write_text(text)
        return folder / "a.txt"

    return write


def without(*columns):
    return files.written(lambda table: table.drop(columns=[*columns]))


def ragged(made, folder):
    """Lists of all joints, of which one lacks a joint."""
    lists = [*made.position[1:].tolist(), [0.0]]
    pd.DataFrame({"t": made.time, "q": lists, "tau": [*made.torque]}).to_parquet(folder / "a.parquet")
    return folder / "a.parquet"


def by_joint(table):
    """A row for each joint, in place of a column."""
    return pd.wide_to_long(table, ["q", "qd", "tau"], i="t", j="joint").reset_index()


def twice(**names):
    """Columns under other names too."""
    return files.written(lambda table: table.assign(**{new: table[old] for new, old in names.items()}))


def stated(**units):
    """Units in brackets behind the names of a signal's columns."""
    headings = {f"{name}{j}": f"{name}{j} {unit}" for name, unit in units.items() for j in (1, 2)}
    return files.written(lambda table: table.rename(columns=headings))


ARRAYS = {"position": "q", "torque": "tau"}
STATED = [
    ("tau", "V", "torque=N·m"),
    ("tau", "lbf", "torque=N·m"),
    ("tau", "mA", "torque"),
    ("q", "grad", "angle=rad"),
]
FILES = [
    ("there is no recording", lambda _, folder: folder / "a.csv", {}),
    ("neither a file nor a folder", lambda _, folder: os.mkfifo(folder / "a") or folder / "a", {}),
    ("without a bag", lambda _, folder: folder, {}),
    (
        r"has the suffix \.xls, expected \.csv",
        lambda made, to: files.write_csv(made, to).rename(to / "a.xls"),
        {},
    ),
    ("recording.joints has 1 name, the arm has 2 joints", files.written(), {"joints": ["a"]}),
    ("lack a number, in column q2", files.written(lambda table: table.assign(q2=np.nan)), {}),
    ("no position for 1 of the arm's 2 joints: no column 'q2'", without("q2"), {}),
    ("position of 5 joints, the arm has 2; if the first 2", twice(q3="q1", q4="q1", q5="q2"), {}),
    ("no torque for 1 of the arm's 2 joints: no column 'tau2'", without("tau2"), {}),
    (r"no column like 't' or 'time' of time stamps.*recording\.rate=1000", without("t"), {}),
    ("time as 't' and as 'time'; choose one: recording.time=t", twice(time="t"), {}),
    (r"position as 'q\{index\}' and as 'q_\{index\}'; choose one", twice(q_1="q1", q_2="q2"), {}),
    ("is no table: expected a line of column names", of_words("q1,q2\n" + "x" * 200_000), {}),
    ("is no table", of_words("Dear colleagues,\nhere is what you\nasked for\n"), {}),
    ("begins with numbers.*add one", files.written(header=False), {}),
    (
        "100% of its rows .* number, in column t",
        files.written(lambda table: table.assign(t="running")),
        {},
    ),
    ("number, in column q1", files.written(lambda table: table.assign(q1=table.q1 * 1e300)), {}),
    ("75% of its rows .* tau2", files.written(lambda table: table.assign(tau2=table.tau2[::4])), {}),
    (r"'tau1 \(%\)' is a share of a rated .*: recording\.units\.torque=N·m", stated(tau="(%)"), {}),
    *(
        (rf"1 .* states '{x}', .* already: recording\.units\.{to}", stated(**{name: f"[{x}]"}), {})
        for name, x, to in STATED
    ),
    (
        r"known are A, mA.* recording\.units\.current=A$",
        files.written(lambda table: table.rename(columns={"tau1": "i1 [V]", "tau2": "i2 [V]"})),
        {},
    ),
    ("occurs twice", files.written(lambda table: table.rename(columns={"q2": "q1"})), {}),
    ("a row for each joint, by 'joint', expected .*columns='joint'", files.written(by_joint), {}),
    ("column q must have one list of numbers per row, all equally long", ragged, {}),
    ("differ in length: t has 200, q has 3", files.arrays(q=np.ones((3, 2))), ARRAYS),
    ("the arm has 2 joints", files.arrays(q=np.ones((200, 3))), ARRAYS),
    ("one number per row: q is .200, 2, 2", files.arrays(q=np.zeros((200, 2, 2))), ARRAYS),
    ("is not a complete npz file", files.arrays(q=np.array([{}] * 200)), ARRAYS),
    ("array q holds complex128, expected real numbers", files.arrays(q=1j * np.ones((200, 2))), ARRAYS),
    ("has no joint 1, 2; it has x, y", partial(files.write_bag, names=["x", "y"]), {}),
    ("has joint states on /joint_states, not on /arm", files.write_bag, {"topic": "/arm"}),
    ("have position, .* not acceleration", lambda made, to: Files("", None, str(bag(made, to)), ""), {}),
    (r"has no joint states .*; it has /joint_states \(std_msgs/msg/String\)", of_text, {}),
]


@pytest.mark.parametrize(("words", "write", "changes"), FILES, ids=[words for words, *_ in FILES])
def test_unreadable_files_are_refused(made, tmp_path, words, write, changes):
    with pytest.raises(RecordingError, match=words):
        load_recording(write(made, tmp_path), of_file(**changes), ("1", "2"))


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.npz", "a.mcap", "a.db3"])
@pytest.mark.parametrize("content", [b"", b"\x93garbage\x00\xff" * 99])
def test_empty_and_garbage_files_are_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with pytest.raises(RecordingError, match=name.replace(".", r"\.")):
        load_recording(tmp_path / name, of_file(), ("1", "2"))


@pytest.mark.parametrize("write", [files.write_parquet, files.arrays(), files.write_mcap, files.write_bag])
def test_truncated_files_are_refused(made, tmp_path, write):
    path = write(made, tmp_path)
    file = path if path.is_file() else max(path.iterdir(), key=lambda p: p.stat().st_size)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 3])
    with pytest.raises(RecordingError):
        load_recording(path, of_file(), made.joint_names)


def but(signal, change):
    return lambda recording: replace(recording, **{signal: change(getattr(recording, signal))})


def scaled(signal, factor):
    return but(signal, lambda x: factor * x)


def currents(factor=1.0):
    """Currents [A] of drives with gains of two, or as many times too large, in place of torques."""
    return lambda recording: replace(recording, torque=None, current=factor / 2 * recording.torque)


def change_elbow(signal, change):
    return but(signal, lambda x: np.stack([x[:, 0], change(x[:, 1])], 1))


def shuffled(time):
    return np.where(np.arange(len(time)) == 100, time[90], time)


def unpadded(time):
    """Seconds and nanoseconds of a clock, with a point between them."""
    stamps = (1e9 * (time + 5)).round().astype(int).tolist()
    return np.array([float(f"{t // 10**9}.{t % 10**9}") for t in stamps])


def spike(torque):
    return torque + 1e6 * (np.arange(len(torque)) == 700)


def interrupted(time):
    """A sample that is stamped like the one before it, and two seconds without samples."""
    k = np.arange(len(time))
    return np.where(k == 700, time[699], time) + 2.0 * (k >= 1000)


def limited(torque):
    return replace(PLANAR, torque_limit=np.full(2, torque))


def check(recording, arm=PLANAR, gains=None, **changes):
    return check_recording(recording, arm, of_file(**changes), gains)


def missing(recording):
    """Rows were lost, and a clock was counted afterwards."""
    lost = part_of(recording, [k for k in range(len(recording.time)) if not 700 < k < 760])
    return replace(lost, time=recording.time[: len(lost.time)])


def within_a_turn(recording):
    """Positions in degrees, from 0 to 360."""
    return replace(recording, position=np.rad2deg(recording.position % (2 * np.pi)), velocity=None)


def lost(samples):
    """Which samples of a recording follow the 700th."""
    return [700 < k <= 700 + samples for k in range(2000)]


JUMPS = r"(shoulder|elbow) jumps by .* rad after sample 701, at .*: are rows missing"
DEGREES, GAINS, TWO = 180 / math.pi, r"are the drive gains \(robot\.gains\)", (2.0, 2.0)
UNITS = [("ms", "s", 1e3), ("ns", "s", 1e9), ("us", "ms", 1e3)]
DEAD = "velocity of shoulder, elbow is constant.*velocity=null"
LOW = r"the cut-off is .* Hz, expected more than 0\.2 Hz"
CHECKED = [
    ("are these degrees", scaled("position", DEGREES), {}),
    (r"are these degrees\? \(recording\.units\.angle=deg\)", within_a_turn, {}),
    ("are these radians", scaled("position", 1 / DEGREES), {"units": {"angle": "deg"}}),
    ("one is in degrees", scaled("velocity", DEGREES), {}),
    *((rf"another unit.*units\.time={x}\)", scaled("time", f), {"units": {"time": y}}) for x, y, f in UNITS),
    (r"resolution of 1 s, 1980 of 2000 .*time=none recording\.rate=100$", but("time", np.floor), {}),
    (r"times its limit: .*\(recording\.units\.current=mA\)", currents(1e3), {"gains": TWO}),
    (GAINS, currents(1e3), {"gains": TWO, "units": {"current": "mA"}}),
    (GAINS, currents(), {"gains": (2e5, 2e5)}),
    ("times what the description predicts", currents(1e3), {"gains": TWO, "arm": limited(np.inf)}),
    ("is it in N·m, and the joint order", scaled("torque", 1e7), {}),
    ("hardly moves: no joint by more than 0", scaled("position", 1e-4), {}),
    ("every torque is zero", but("torque", np.zeros_like), {}),
    (
        r"torque of shoulder, elbow is blank or constant .*; record with shoulder, elbow at rest",
        but("torque", np.ones_like),
        {},
    ),
    (
        r"torque of elbow is blank .*; record with elbow at rest, .*without=\[elbow\].*robot.tip=upper_arm$",
        but("torque", lambda x: x * [1.0, 0.0]),
        {},
    ),
    ("has 9 samples, expected 10 or more", lambda recording: part_of(recording, slice(9)), {}),
    ("has 1 sample, expected 10 or more", lambda recording: part_of(recording, slice(1)), {}),
    ("too short to identify from", scaled("time", 1e-300), {}),
    ("neither torque nor current", but("torque", lambda _: None), {}),
    (DEAD, but("velocity", np.ones_like), {}),
    ("all samples have the same time stamp", but("time", np.ones_like), {}),
    ("time runs backwards.* after sample 100: sort its rows by time$", but("time", shuffled), {}),
    ("backwards.*: sort its rows by time", but("time", lambda x: x[::-1]), {}),
    ("after sample 1000: the clock restarts, so split", but("time", lambda x: np.r_[x[:1000], x[:1000]]), {}),
    ("and so on .* times: were nanoseconds put behind the point", but("time", unpadded), {}),
    (
        r"elbow is 1e\+06 N·m at [67].* s, and beyond .* in only 1 sample of 2000",
        change_elbow("torque", spike),
        {},
    ),
    ("set the drive gains", currents(), {}),
    ("robot.gains has 3 drive gains, the arm has 2 joints", currents(), {"gains": (1.0, 1.0, 1.0)}),
    ("robot.gains has 1 drive gain, the arm has 2 joints", currents(), {"gains": (1.0,)}),
    ("reverse names wrist", lambda same: same, {"reverse": ["wrist"]}),
    ("no joint stays faster than 100 rad/s", lambda same: same, {"still": 100.0}),
    (JUMPS, change_elbow("position", lambda x: x + 0.4 * (np.arange(len(x)) > 700)), {}),
    (JUMPS, missing, {}),
    (r"elbow jumps by", change_elbow("position", lambda x: np.where(lost(5), 0.0, x)), {}),
    (LOW, lambda same: same, {"cutoff": 1e-11}),
]


@pytest.mark.parametrize(("words", "change", "options"), CHECKED)
def test_implausible_recordings_are_refused(recording, words, change, options):
    with pytest.raises(RecordingError, match=words):
        check(change(recording), **options)


WARNED = [
    ("recording.reverse=[elbow]", change_elbow("torque", np.negative)),
    ("swapped, scaled or reversed?", change_elbow("velocity", np.negative)),
    ("the arm hardly moves", scaled("position", 0.1)),
    ("elbow never moved", lambda r: replace(change_elbow("position", np.zeros_like)(r), velocity=None)),
    ("1 gap, the longest 2", but("time", interrupted)),
    ("1 sample with a repeated time stamp", but("time", interrupted)),
    ("the torque of shoulder, elbow is coarsely", but("torque", lambda x: (x / 9).round() * 9)),
    ("looks saturated", but("torque", lambda x: np.minimum(x, x.max() / 2))),
    ("looks saturated", but("torque", lambda x: np.minimum(x, x.max() / 2).round(1))),
    ("1 corrupt row, left out; the first is row 7: ", but("corrupt", lambda _: ((7, "no number in q1"),))),
    (
        "is this the right arm, and its joint order?",
        lambda r: replace(r, torque=np.sin(r.time[:, None] * [3.1, 4.3])),
    ),
]


@pytest.mark.parametrize("samples", [1, 3, 4])
def test_positions_that_jump_and_return_are_left_out(recording, samples):
    at = lost(samples)
    zeros = replace(recording, position=np.where(np.transpose([at]), 0.0, recording.position))
    rest = part_of(recording, np.flatnonzero(~np.array(at)))
    found, clean = check(zeros), check(rest)
    assert f"elbow jumps and returns at {recording.time[701]:.6g}" in found.warnings[0]
    assert f"{samples} sample" in found.warnings[0] and found.warnings[1:] == clean.warnings
    np.testing.assert_array_equal(found.segments[0].position, clean.segments[0].position)


def test_held_and_quantised_torques_are_not_taken_for_saturated(recording):
    k = np.arange(len(recording.time))
    held = replace(recording, torque=recording.torque[k - k % 8])
    noise = np.random.default_rng(0).standard_normal(recording.torque.shape)
    found = [held]
    for quantum in (1, 2):
        for scatter in (0, 0.2, 0.5):
            torque = (recording.torque + scatter * noise) / quantum
            found.append(replace(recording, torque=torque.round() * quantum))
    assert not [text for made in found for text in check(made).warnings if "saturated" in text]


@pytest.mark.parametrize(("words", "change"), WARNED, ids=[words for words, _ in WARNED])
def test_suspicious_recordings_are_warned_about(recording, words, change):
    assert words in "\n".join(check(change(recording)).warnings)


def test_torque_limits_too_low_to_hold_the_arm_only_warn(recording):
    warnings = check(recording, limited(1e-3)).warnings
    assert "the torque of shoulder, elbow exceeds the arm's limit" in "\n".join(warnings)
