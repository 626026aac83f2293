"""Files of other programs: clocks, units in headings, blank cells, containers; and what is mended in them."""

import json
import re
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import scipy

from sidegan.errors import RecordingError
from sidegan.recording.check import check_recording
from sidegan.recording.load import load_recording
from tests.recording.conftest import of_file, recorded
from tests.recording.files import frame

JOINTS, EPOCH = ("left_joint_1", "left_joint_2"), 1_690_000_000
DEGREES = 180 / np.pi


def table(made, **columns):
    """Time, positions and torques of a recording; columns may be changed, added, or, as None, left out."""
    changed = {**frame(made)[["t", "q1", "q2", "tau1", "tau2"]], **columns}
    return pd.DataFrame({name: x for name, x in changed.items() if x is not None})


def at(made):
    """Its stamps as dates, in whole nanoseconds."""
    return pd.to_datetime((made.time * 1e9).round().astype(np.int64) + EPOCH * 10**9)


def since_1970(made, unit):
    return ((made.time + EPOCH) * unit).round().astype(np.int64)


def headed(made, time, q, tau):
    """Times, angles and torques in milliseconds, degrees and N·mm, under headings that say so."""
    values = made.position * DEGREES, made.torque * 1e3
    columns = {p.format(k + 1): x[:, k] for p, x in zip((q, tau), values) for k in range(2)}
    return pd.DataFrame({time: made.time * 1e3, **columns})


def parquet(path, made, **options):
    made.to_parquet(path / "a.parquet", **options)


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


def arrays(made, path):
    np.savez(path / "a.npz", t=made.time, q=made.position.T, tau=made.torque, pose=np.ones((len(made), 6)))


def two_arms(made, path):
    other = {f"{name}_right_joint_{k}": 9.0 + k for name in ("q", "tau") for k in (1, 2)}
    names = {f"{name}{k}": f"{name}_left_joint_{k}" for name in ("q", "tau") for k in (1, 2)}
    text(table(made).rename(columns=names).assign(**other), path)


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
    "datetime": (lambda m, p: parquet(p, table(m, t=at(m))), EPOCH, ""),
    "datetime with a zone": (
        lambda m, p: parquet(p, table(m, t=at(m).tz_localize("UTC").tz_convert("Asia/Tokyo"))),
        EPOCH,
        "",
    ),
    "datetime index": (lambda m, p: parquet(p, table(m).set_index("t")), 0, ""),
    "index without a name": (lambda m, p: parquet(p, table(m, t=None).set_index(at(m))), EPOCH, ""),
    "units and blanks": (
        lambda m, p: text(headed(m, "Time (ms)", "J{} Pos (deg)", "J{} Torque (N·mm)"), p),
        0,
        "time in ms, position in deg, torque in mNm, as the columns are headed",
    ),
    "units": (lambda m, p: text(headed(m, "time_ms", "q{}_deg", "tau_{}_mNm"), p), 0, "position in deg"),
    "UTF-16": (lambda m, p: text(table(m), p, "utf-16", sep="\t"), 0, ""),
    "cp1252": (
        lambda m, p: text(headed(m, "Zeit t [ms]", "Pos {} [°]", "tau{} [mNm]"), p, "cp1252", sep=";"),
        0,
        "position in deg",
    ),
    "echo --csv": (echoed, 1, ""),
    "JSON lines": (lines, 1, ""),
    "MATLAB": (matlab, 0, ""),
    "arrays": (arrays, 0, ""),
    "two arms": (two_arms, 0, ""),
}


@pytest.mark.parametrize("kind", KINDS)
def test_kinds(made, tmp_path, kind):
    write, start, remark = KINDS[kind]
    write(made, tmp_path)
    (path,) = tmp_path.iterdir()
    found = load_recording(path, of_file(joints=["b", "a"] if kind == "JSON lines" else None), JOINTS)
    np.testing.assert_allclose(found.time, made.time + start, atol=1e-3 if "ms " in kind else 2e-6, rtol=0)
    for name in ("position", "torque"):
        np.testing.assert_allclose(getattr(found, name), getattr(made, name), atol=1e-7)
    assert remark in "".join(found.remarks) and bool(remark) == bool(found.remarks)
    assert [row for row, _ in found.corrupt] == ([201] if kind == "JSON lines" else [])


def read(folder, table, sliding=(), **changes):
    text(table, folder)
    return load_recording(folder / "a.csv", of_file(**changes), JOINTS, sliding=sliding)


@pytest.fixture
def sliding(planar):
    """The planar arm with a second joint that slides."""
    lower, upper = np.array([[-2.5, -1.6], [2.5, 1.6]])
    slides = np.array([False, True])
    return replace(planar, prismatic=slides, position_lower=lower, position_upper=upper)


@pytest.mark.parametrize("headings", [("q1", "q2"), ("q1_deg", "q2_mm"), ("J1 Pos (deg)", "J2 Pos (mm)")])
def test_degrees_are_of_joints_that_turn_and_millimetres_of_those_that_slide(made, tmp_path, headings):
    q = made.position * [DEGREES, 1e3]
    units = {"angle": "deg", "length": "mm"} if headings == ("q1", "q2") else {}
    written = table(made, **{"q1": None, "q2": None, **dict(zip(headings, q.T))})
    found = read(tmp_path, written, JOINTS[1:], units=units)
    np.testing.assert_allclose(found.position, made.position)


@pytest.mark.parametrize(("unit", "factor", "words"), [("m", 1e3, "millimetres"), ("mm", 1e-3, "metres")])
def test_a_joint_that_slides_in_another_unit_is_refused(sliding, clock, unit, factor, words):
    made = recorded(sliding, clock, ("position", "torque"))
    wrong = replace(made, position=made.position * [1.0, factor])
    assert not any("unit" in warning for warning in check_recording(made, sliding, of_file()).warnings)
    with pytest.raises(RecordingError, match=rf"elbow .*are these {words}\? \(recording\.units\.length="):
        check_recording(wrong, sliding, of_file(units={"length": unit}))


def test_counts_of_encoders_are_refused_with_the_line_that_converts_them(recording, planar, tmp_path):
    counts = (recording.position / (2 * np.pi) * 4096 + 2048).round()
    with pytest.raises(RecordingError, match="no unit explains: are these counts") as error:
        check_recording(replace(recording, velocity=None, position=counts), planar, of_file())
    per_turn, zero = map(float, re.findall(r"(?:per_turn|zero): (\d+)", str(error.value)))
    units = {"position": {"per_turn": [per_turn, -per_turn], "zero": zero}}
    columns = dict(zip(("q1", "q2"), counts.T))
    found = read(tmp_path, table(recording, **columns, qd1=1.0, qd2=1.0), units=units)
    np.testing.assert_allclose(found.position, recording.position * [1, -1], atol=np.pi / 4096, rtol=0)
    assert found.velocity is None and "velocity is derived" in found.remarks[0]
    with pytest.raises(RecordingError, match=r"units\.position\.zero is of 3 joints, the arm has 2"):
        read(tmp_path, table(recording), units={"position": {"per_turn": 4096, "zero": [0, 0, 0]}})


def test_turns_that_a_driver_takes_off_are_put_back(recording, tmp_path):
    """And nothing is put back of a joint that slides, or of degrees, which step by more than a turn, too."""
    far = recording.position * [4.0, 1.0] + np.array([3.0, 0.0])
    wrapped = (far + np.pi) % (2 * np.pi) - np.pi
    columns = dict(zip(("q1", "q2"), wrapped.T))
    found = read(tmp_path, table(recording, **columns))
    turns = (found.position - far) / (2 * np.pi)
    np.testing.assert_allclose(turns, np.broadcast_to(turns[:1].round(), turns.shape), atol=1e-9, rtol=0)
    assert found.remarks[0].startswith("readings of left_joint_1 jump by whole turns")
    slid = read(tmp_path, table(recording, **columns), JOINTS)
    np.testing.assert_allclose(slid.position, wrapped)
    slow = table(recording, **dict(zip(("q1", "q2"), DEGREES * recording.position.T)))[::10]
    assert not read(tmp_path, slow).remarks


def test_nanoseconds_since_a_machine_was_started_are_no_milliseconds_since_1970(made, tmp_path):
    found = read(tmp_path, table(made, t=(made.time * 1e9).round() + 1.5e12))
    assert not found.remarks and np.diff(found.time).mean() > 1e6


def at_rest(made, torque, seconds=4.0):
    """A recording with some time at rest, and torques at will, before it."""
    still = np.arange(0, seconds, 0.01)
    first = {name: float(x) for name, x in table(made).iloc[0].items()}
    held = pd.DataFrame({**first, "t": made.time[0].item() - seconds + still, **torque(still)})
    return pd.concat([held, table(made)], ignore_index=True)


def test_rows_at_rest_without_drives_are_left_out(recording, tmp_path):
    found = read(tmp_path, at_rest(recording, lambda _: {"tau1": 0.0, "tau2": 0.0}))
    np.testing.assert_allclose(found.torque, recording.torque)
    assert "no torque changes while the arm rests, as without drives: 400 rows" in found.remarks[0]
    led = table(recording)
    led.loc[:999, ["tau1", "tau2"]] = 0.0  # somebody leads an arm without drives
    for other in ("tau1", "tau2"):
        held = read(tmp_path, at_rest(recording, lambda t, j=other: {"tau1": 0.0, "tau2": 0.0, j: np.sin(t)}))
        assert len(held) == 2400 and not held.remarks
    assert len(read(tmp_path, led)) == 2000


def test_each_signal_is_taken_at_the_rows_that_have_it(recording, tmp_path):
    positions, torques = table(recording, tau1=None, tau2=None), table(recording, q1=None, q2=None)
    later = torques[1::2].assign(t=torques.t[1::2] + 3e-3)
    found = read(tmp_path, pd.concat([positions, later]).sort_values("t"))
    inside = np.isin(recording.time, found.time)
    assert len(found) > 1980 and not found.corrupt
    np.testing.assert_allclose(found.position, recording.position[inside])
    error = np.abs(found.torque - recording.torque[inside]).mean()
    assert error < 0.02 * np.abs(recording.torque).mean()
    assert "the torque of a.csv: interpolated at the time stamps of the position" in found.remarks[0]


@pytest.mark.parametrize("stamps", [lambda t: t, lambda t: np.stack([t, t + 0.5])])
def test_rollouts_are_stretches_of_one_recording(made, tmp_path, stamps):
    t, q, tau = made.time, made.position, made.torque
    np.savez(tmp_path / "a.npz", t=stamps(t), q=np.stack([q, 2 * q]), tau=np.stack([tau, 3 * tau]))
    found = load_recording(tmp_path / "a.npz", of_file(), JOINTS)
    np.testing.assert_allclose(found.position, np.concatenate([q, 2 * q]))
    np.testing.assert_allclose(found.torque, np.concatenate([tau, 3 * tau]))
    steps = np.diff(found.time)
    assert steps[199] == pytest.approx(10) and (np.delete(steps, 199) < 0.02).all()
    assert found.remarks == ("2 rollouts of 200 samples each are stretches of one recording",)


def test_joint_states_without_names_of_two_signals_are_refused_with_the_line_to_write(made, tmp_path):
    echoed(made, tmp_path, ("position", "torque"))
    with pytest.raises(RecordingError, match=r"2 values of each: .* such as stamp\.sec,.*") as error:
        load_recording(tmp_path / "a.csv", of_file(), JOINTS)
    line = str(error.value).partition("such as ")[2]
    (tmp_path / "a.csv").write_text(f"{line}\n{(tmp_path / 'a.csv').read_text()}")
    np.testing.assert_allclose(load_recording(tmp_path / "a.csv", of_file(), JOINTS).torque, made.torque)


def test_a_file_of_matlab_7_3_is_refused_with_what_to_save(tmp_path):
    (tmp_path / "a.mat").write_bytes(b"MATLAB 7.3 MAT-file".ljust(124) + b"\x00\x02IM" + bytes(512))
    with pytest.raises(RecordingError, match=r"MATLAB 7\.3.*-v7"):
        load_recording(tmp_path / "a.mat", of_file(), JOINTS)
