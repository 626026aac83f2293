"""Settings, files and recordings that are refused or warned about, with what the message has to name."""

import math
import os
from dataclasses import replace
from functools import partial

import numpy as np
import pandas as pd
import pytest

from sidegan.errors import ConfigError, RecordingError
from sidegan.recording.clock import stamp_text
from sidegan.recording.settings import Files
from tests.recording import files
from tests.recording.conftest import PLANAR, check, of_file
from tests.refusals import refused

SETTINGS = [
    ("units.angle", {"units": {"angle": "turn"}}),
    ("position", {"position": None}),
    ("joints", {"joints": ["a", "b", "a"]}),
    *((text, {"position": text}) for text in ("q{index}{foo}", "q{index", "q{index:02d}", "{}", "q{0}")),
    *((name, {name: -1.0}) for name in ("cutoff", "still")),
    *(("cutoff", {"cutoff": 0}), ("gap", {"gap": 1e300})),
]


@pytest.mark.parametrize(("name", "changes"), SETTINGS)
def test_invalid_settings_are_refused(name, changes):
    with refused(ConfigError, name):
        of_file(**changes)


foreign_bag = partial(files.write_bag, names=["x", "y"])


def of_text(_, folder):
    return files.write_messages(folder, [(1, True, "hello")], "std_msgs/msg/String")


def of_words(text):
    def write(_, folder):
        (folder / "a.txt").write_text(text)
        return folder / "a.txt"

    return write


def pipe(_, folder):
    os.mkfifo(folder / "a")
    return folder / "a"


def without(*columns):
    return files.written(lambda table: table.drop(columns=[*columns]))


def assigned(column, change):
    """A table in which a column is another."""
    return files.written(lambda table: table.assign(**{column: change(table)}))


def renamed(**names):
    return files.written(lambda table: table.rename(columns=names))


def ragged(made, folder):
    """Lists of all joints, of which one lacks a joint."""
    lists = [*made.position[1:].tolist(), [0.0]]
    pd.DataFrame({"t": made.time, "q": lists, "tau": [*made.torque]}).to_parquet(folder / "a.parquet")
    return folder / "a.parquet"


def many_names(made, folder):
    """A name that occurs twice, at the end of a long line of others."""
    more = files.frame(made).assign(**{f"a long name {k}": 1.0 for k in range(20)})
    more = pd.concat([more.drop(columns="q1"), more[["q1", "q1"]]], axis=1)
    more.to_csv(folder / "a.csv", index=False)
    return folder / "a.csv"


def blank_velocities(made, folder):
    """Positions and torques in rows of their own, and columns of velocities without any number."""
    table = files.frame(made).assign(qd1=np.nan, qd2=np.nan)
    rows = [table.assign(tau1=np.nan, tau2=np.nan), table.assign(q1=np.nan, q2=np.nan)]
    pd.concat(rows).sort_values("t").to_csv(folder / "a.csv", index=False)
    return folder / "a.csv"


def by_joint(table):
    """A row for each joint, in place of a column."""
    return pd.wide_to_long(table, ["q", "qd", "tau"], i="t", j="joint").reset_index()


def twice(**names):
    """Columns under other names too."""
    return files.written(lambda table: table.assign(**{new: table[old] for new, old in names.items()}))


def stated(name, unit):
    """A unit in brackets behind the names of a signal's columns."""
    return renamed(**{f"{name}{j}": f"{name}{j} {unit}" for j in (1, 2)})


ARRAYS = {"position": "q", "torque": "tau"}
FILES = {  # how a file is written, how it is read, and what the message names
    "no such file": (lambda _, folder: folder / "a.csv", {}, "a.csv"),
    "a pipe": (pipe, {}, "a"),
    "a folder": (lambda _, folder: folder, {}, ".mcap"),
    "a suffix": (lambda made, to: files.write_csv(made, to).rename(to / "a.xls"), {}, ".xls .csv"),
    "too few joints named": (files.written(), {"joints": ["a"]}, "recording.joints"),
    "a blank column": (assigned("q2", lambda _: np.nan), {}, "a.csv q2"),
    "no pattern": (files.write_csv, {"position": ""}, "'position_1'"),
    "no position of a joint": (without("q2"), {}, "a.csv 'q2'"),
    "positions of many more": (twice(q3="q1", q4="q1", q5="q2"), {}, 'recording.position="q{index}"'),
    "no torque of a joint": (without("tau2"), {}, "'tau2' recording.without"),
    "no torque of another": (without("tau2"), {"without": ["shoulder"]}, "without=[shoulder, elbow]"),
    "no stamps": (without("t"), {}, "'t' recording.rate=1000"),
    "two times": (twice(time="t"), {}, "'time' recording.time=t"),
    "two positions": (twice(q_1="q1", q_2="q2"), {}, "'q_{index}' recording.position"),
    "a long line": (of_words("q1,q2\n" + "x" * 200_000), {}, "a.txt"),
    "prose": (of_words("Dear colleagues,\nhere is what you\nasked for\n"), {}, "a.txt"),
    "no header": (files.written(header=False), {}, "a.csv t,q1,q2"),
    "words for times": (assigned("t", lambda _: "running"), {}, "a.csv 100% t"),
    "huge numbers": (assigned("q1", lambda table: table.q1 * 1e300), {}, "a.csv q1"),
    "mostly blank": (assigned("tau2", lambda table: table.tau2[::4]), {}, "75% tau2"),
    "per cent": (stated("tau", "(%)"), {}, "'tau1 (%)' 'recording.units.torque=\"N·m\"'"),
    "volts": (stated("tau", "[V]"), {}, "'V' 'recording.units.torque=\"N·m\"'"),
    "pounds": (stated("tau", "[lbf]"), {}, "'lbf' 'recording.units.torque=\"N·m\"'"),
    "milliampere": (stated("tau", "[mA]"), {}, "'mA' 'recording.units.torque=\"N·m\"'"),
    "grad": (stated("q", "[grad]"), {}, "'grad' recording.units.angle=rad"),
    "currents in volts": (renamed(tau1="i1 [V]", tau2="i2 [V]"), {}, "'V' recording.units.current=A"),
    "a name twice": (many_names, {}, "a.csv 'q1'"),
    "a blank signal beside blank cells": (blank_velocities, {}, "a.csv velocity"),
    "a row for each joint": (files.written(by_joint), {}, "columns='joint'"),
    "ragged lists": (ragged, {}, "a.parquet q"),
    "a short array": (files.arrays(q=np.ones((3, 2))), ARRAYS, "t has 200 q has 3"),
    "commanded ones": (renamed(tau1="tau_cmd1", tau2="tau_cmd2"), {"torque": "tau{index}"}, "'tau1'"),
    "a wide array": (files.arrays(q=np.ones((200, 3))), ARRAYS, "'q' 2 joints"),
    "a cube": (files.arrays(q=np.zeros((200, 2, 2))), ARRAYS, "a.npz q"),
    "objects": (files.arrays(q=np.array([{}] * 200)), ARRAYS, "a.npz"),
    "complex numbers": (files.arrays(q=1j * np.ones((200, 2))), ARRAYS, "a.npz q complex128"),
    "another arm": (foreign_bag, {}, "shoulder, elbow x, y"),
    "another topic": (files.write_bag, {"topic": "/arm"}, "/joint_states /arm"),
    "no accelerations": (
        lambda made, to: Files("", None, str(files.write_bag(made, to)), ""),
        {},
        "acceleration",
    ),
    "no joint states": (of_text, {}, "/joint_states std_msgs/msg/String"),
}


@pytest.mark.parametrize(("write", "changes", "about"), FILES.values(), ids=FILES)
def test_unreadable_files_are_refused(made, tmp_path, write, changes, about):
    path = write(made, tmp_path)
    with refused(RecordingError, *about.split()):
        files.load(path, **changes)


@pytest.mark.parametrize("name", ["a.csv", "a.parquet", "a.npz", "a.mcap", "a.db3"])
@pytest.mark.parametrize("content", [b"", b"\x93garbage\x00\xff" * 99])
def test_empty_and_garbage_files_are_refused(tmp_path, name, content):
    (tmp_path / name).write_bytes(content)
    with refused(RecordingError, name):
        files.load(tmp_path / name)


@pytest.mark.parametrize("write", [files.write_parquet, files.arrays(), files.write_mcap, files.write_bag])
def test_truncated_files_are_refused(made, tmp_path, write):
    path = write(made, tmp_path)
    file = path if path.is_file() else max(path.iterdir(), key=lambda p: p.stat().st_size)
    file.write_bytes(file.read_bytes()[: file.stat().st_size // 3])
    with refused(RecordingError):
        files.load(path)


def but(signal, change):
    return lambda recording: replace(recording, **{signal: change(getattr(recording, signal))})


def scaled(signal, factor):
    return but(signal, lambda x: factor * x)


def currents(factor=1.0):
    """Currents [A] of drives with gains of two, or as many times too large, in place of torques."""
    return lambda recording: replace(recording, torque=None, current=factor / 2 * recording.torque)


def of_elbow(signal, change):
    return but(signal, lambda x: np.stack([x[:, 0], change(x[:, 1])], 1))


def first(samples):
    return lambda recording: recording.take(slice(samples))


def as_it_is(recording):
    return recording


def shuffled(time):
    return np.where(np.arange(len(time)) == 100, time[90], time)


def since_1970(time):
    return 1.69e9 + shuffled(time)


def jumping_since_1970(recording):
    position = recording.position + 0.4 * (np.arange(2000) > 700)[:, None]
    return replace(recording, time=1.69e9 + recording.time, position=position)


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


def lost(samples):
    """Which samples of a recording follow the 700th."""
    k = np.arange(2000)
    return (k > 700) & (k <= 700 + samples)


def missing(recording):
    """Rows were lost, and a clock was counted afterwards."""
    rest = recording.take(np.flatnonzero(~lost(59)))
    return replace(rest, time=recording.time[: len(rest.time)])


def within_a_turn(recording):
    """Positions in degrees, from 0 to 360."""
    return replace(recording, position=np.rad2deg(recording.position % (2 * np.pi)), velocity=None)


SLIDING = replace(PLANAR, prismatic=np.ones(2, bool))


def limited(torque):
    return replace(PLANAR, torque_limit=np.full(2, torque))


DEGREES, TWO = 180 / math.pi, (2.0, 2.0)
IN_DEGREES = {"units": {"angle": "deg"}}
CHECKED = {  # what was changed, how it is checked, and what the message names
    "degrees": (scaled("position", DEGREES), {}, "recording.units.angle=deg"),
    "degrees in a turn": (within_a_turn, {}, "recording.units.angle=deg"),
    "radians": (scaled("position", 1 / DEGREES), IN_DEGREES, "recording.units.angle=rad"),
    "slow radians": (scaled("position", 0.1 / DEGREES), IN_DEGREES, "recording.units.angle=rad"),
    "rates in degrees": (scaled("velocity", DEGREES), {}, "velocity degrees"),
    "milliseconds": (scaled("time", 1e3), {}, "recording.units.time=ms"),
    "nanoseconds": (scaled("time", 1e9), {}, "recording.units.time=ns"),
    "microseconds": (scaled("time", 1e3), {"units": {"time": "ms"}}, "recording.units.time=us"),
    "whole seconds": (but("time", np.floor), {}, "1980 recording.time=none recording.rate=100"),
    "milliampere": (currents(1e3), {"gains": TWO}, "recording.units.current=mA robot.limits.effort"),
    "currents": (currents(1e3), {"gains": TWO, "units": {"current": "mA"}}, "robot.gains"),
    "gains": (currents(), {"gains": (2e5, 2e5)}, "robot.gains"),
    "without limits": (currents(1e3), {"gains": TWO, "arm": limited(np.inf)}, "description"),
    "torques": (scaled("torque", 1e7), {}, "N·m recording.current"),
    "forces": (scaled("torque", 1e7), {"arm": SLIDING}, "in N, recording.current"),
    "no motion": (scaled("position", 1e-4), {}, "made"),
    "no torques": (but("torque", np.zeros_like), {}, "every torque"),
    "constant torques": (but("torque", np.ones_like), {}, "shoulder, elbow recording.without"),
    "a blank torque": (but("torque", lambda x: x * [1, 0]), {}, "without=[elbow] robot.tip=upper_arm"),
    "nine samples": (first(9), {}, "9 samples"),
    "one sample": (first(1), {}, "1 sample,"),
    "no duration": (scaled("time", 1e-300), {}, "made"),
    "no signal": (but("torque", lambda _: None), {}, "torque current"),
    "constant velocities": (but("velocity", np.ones_like), {}, "shoulder, elbow recording.velocity=null"),
    "one stamp": (but("time", np.ones_like), {}, "same time stamp"),
    "a stamp too early since 1970": (but("time", since_1970), {}, "1690000000.99 sort"),
    "a jump since 1970": (jumping_since_1970, {}, "1690000007.00"),
    "a stamp too early": (but("time", shuffled), {}, "sample 100: sort"),
    "backwards": (but("time", lambda x: x[::-1]), {}, "sample 1: sort"),
    "a restart": (but("time", lambda x: np.r_[x[:1000], x[:1000]]), {}, "sample 1000: restarts"),
    "no leading zeros": (but("time", unpadded), {}, "nanoseconds"),
    "a wild torque": (of_elbow("torque", spike), {}, "elbow 1e+06 1 sample of 2000"),
    "no gains": (currents(), {}, "robot.gains"),
    "too many gains": (currents(), {"gains": (1.0, 1.0, 1.0)}, "robot.gains 3 2"),
    "too few gains": (currents(), {"gains": (1.0,)}, "robot.gains 1 2"),
    "a reversed stranger": (as_it_is, {"reverse": ["wrist"]}, "recording.reverse wrist"),
    "always at rest": (as_it_is, {"still": 100.0}, "100 rad/s"),
    "a jump": (of_elbow("position", lambda x: x + 0.4 * (np.arange(len(x)) > 700)), {}, "elbow 701"),
    "missing rows": (missing, {}, "701"),
    "five samples away": (of_elbow("position", lambda x: np.where(lost(5), 0.0, x)), {}, "elbow 701"),
    "many gaps": (but("time", lambda x: x + np.arange(2000) // 6), {}, "gaps"),
    "a low cut-off": (as_it_is, {"cutoff": 1e-11}, "0.2 Hz"),
}


@pytest.mark.parametrize(("change", "options", "about"), CHECKED.values(), ids=CHECKED)
def test_implausible_recordings_are_refused(recording, change, options, about):
    with refused(RecordingError, *about.split()):
        check(change(recording), **options)


WARNED = [  # what the warning says, what was changed, and how it is checked
    ("recording.reverse=[elbow]", of_elbow("torque", np.negative), {}),
    ("recording.velocity=null", of_elbow("velocity", np.negative), {}),
    ("57.30 (shoulder), 57.30 (elbow) times", scaled("velocity", DEGREES), {"arm": SLIDING}),
    ("the arm hardly moves", scaled("position", 0.1), {}),
    ("elbow never moved", lambda r: replace(of_elbow("position", np.zeros_like)(r), velocity=None), {}),
    ("1 gap, the longest 2", but("time", interrupted), {}),
    ("1 sample with a repeated time stamp", but("time", interrupted), {}),
    ("shoulder, elbow is coarsely quantised", but("torque", lambda x: (x / 9).round() * 9), {}),
    ("saturated", but("torque", lambda x: np.minimum(x, x.max() / 2)), {}),
    ("saturated", but("torque", lambda x: np.minimum(x, x.max() / 2).round(1)), {}),
    ("row 7: no number in q1", but("corrupt", lambda _: ((7, "no number in q1"),)), {}),
    ("right arm", lambda r: replace(r, torque=np.sin(r.time[:, None] * [3.1, 4.3])), {}),
    ("torque of shoulder, elbow exceeds the arm's limit", as_it_is, {"arm": limited(1e-3)}),
    ("robot.gains is not used", as_it_is, {"gains": TWO}),
    ("recording.effort=current", as_it_is, {"gains": TWO}),
]


@pytest.mark.parametrize(("words", "change", "options"), WARNED)
def test_suspicious_recordings_are_warned_about(recording, words, change, options):
    assert words in "\n".join(check(change(recording), **options).warnings)


@pytest.mark.parametrize("samples", [1, 3, 4])
def test_positions_that_jump_and_return_are_left_out(recording, samples):
    at = lost(samples)
    zeros = replace(recording, position=np.where(at[:, None], 0.0, recording.position))
    found, clean = check(zeros), check(recording.take(np.flatnonzero(~at)))
    for words in ("elbow", stamp_text(recording.time[701]), f"{samples} sample"):
        assert words in found.warnings[0]
    assert found.warnings[1:] == clean.warnings
    np.testing.assert_array_equal(found.segments[0].position, clean.segments[0].position)


def test_held_and_quantised_torques_are_not_taken_for_saturated(recording):
    k = np.arange(len(recording.time))
    found = [replace(recording, torque=recording.torque[k - k % 8])]
    noise = np.random.default_rng(0).standard_normal(recording.torque.shape)
    for quantum in (1, 2):
        for scatter in (0, 0.2, 0.5):
            torque = (recording.torque + scatter * noise) / quantum
            found.append(replace(recording, torque=torque.round() * quantum))
    assert not [text for made in found for text in check(made).warnings if "saturated" in text]
