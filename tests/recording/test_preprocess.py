import tracemalloc
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np
import pyarrow as pa
import pyarrow.csv
import pyarrow.parquet
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.recording.grid import continuous_stretches
from sidegan.recording.recording import Recording
from sidegan.recording.segments import preprocess
from sidegan.recording.statistics import statistics_of
from tests.recording.conftest import of_file, recorded, states
from tests.recording.files import frame, load


def test_a_missing_acceleration_is_derived(recording):
    (segment,) = preprocess(recording, of_file())
    for name, x in zip(("position", "velocity", "acceleration"), states(segment.time)):
        np.testing.assert_allclose(getattr(segment, name), x, atol=2e-2, rtol=0)


def test_short_gaps_of_a_fast_log_are_bridged(planar):
    """Four gaps of 8 ms at 1 kHz; a gap longer than a quarter of the cut-off's period is not bridged."""
    time = np.arange(12_000) * 1e-3
    short_gaps = np.concatenate([np.arange(k, k + 8) for k in (2000, 4500, 7000, 9500)])
    recording = recorded(planar, np.delete(time, short_gaps))
    (segment,) = preprocess(recording, of_file())
    (smooth,) = preprocess(recorded(planar, time), of_file())
    assert len(segment.time) == pytest.approx(len(smooth.time), abs=2)
    assert len(segment.time) < len(time) / 5  # what is kept follows from the bandwidth, not from the rate
    statistics = statistics_of(recording, of_file())
    assert statistics.bridged == 4 and not statistics.gaps
    assert statistics.gap == pytest.approx(0.25 / (12 * statistics.bandwidth))
    q, _, _ = states(segment.time)
    np.testing.assert_allclose(segment.position, q, atol=2e-3, rtol=0)
    assert len(preprocess(recording, of_file(gap=0.005))) == 5
    assert len(preprocess(recorded(planar, np.delete(time, np.arange(5000, 5080))), of_file())) == 2


def test_samples_at_rest_are_dropped(planar):
    time = np.arange(3000) * 0.01
    stopped = np.where(time < 10, time, np.where(time < 20, 10.0, time - 10))
    q, _, _ = states(stopped)
    recording = Recording("stops", planar.joint_names, time, q, torque=q)
    first, second = preprocess(recording, of_file(cutoff=6.0))
    assert 9.5 < first.time[-1] < 10.5 and 19.5 < second.time[0] < 20.5
    (whole,) = preprocess(recording, of_file(cutoff=6.0, still=0.0))
    assert whole.time[-1] - whole.time[0] > 29


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.5])
def test_filtering_a_long_recording_in_blocks_leaves_no_seams(planar, delay):
    time = np.arange(110_000) * 1e-3
    made = Recording("long", planar.joint_names, time, states(time)[0], torque=states(time - delay)[0])
    (segment,) = preprocess(made, of_file(), delay=delay)
    inner = slice(500, -500)  # several seconds away from the ends
    for x, expected in zip(segment[1:5], [*states(segment.time), states(segment.time)[0]]):
        np.testing.assert_allclose(x[inner], expected[inner], atol=1e-6, rtol=0)


def peaks(folder):
    """Largest memory [bytes] while a.csv and a.parquet are read, and while what was read is reduced."""
    found, read = [], None
    tracemalloc.start()
    for name in ("a.csv", "a.parquet"):
        del read  # that of the other format
        tracemalloc.reset_peak()
        read = load(folder / name)
        found.append(tracemalloc.get_traced_memory()[1])
    tracemalloc.reset_peak()
    preprocess(read, of_file())
    found.append(tracemalloc.get_traced_memory()[1])
    tracemalloc.stop()
    return found


def test_a_long_recording_needs_little_more_memory_than_its_numbers(planar, tmp_path):
    """In a process of its own, where no other test's modules allocate."""
    with ProcessPoolExecutor(1, get_context("spawn")) as pool:
        for seconds in (3, 400):  # the first time, what is imported is counted too
            made = recorded(planar, np.arange(1000 * seconds) * 1e-3)
            table = pa.Table.from_pandas(frame(made))
            pa.csv.write_csv(table, tmp_path / "a.csv")
            pa.parquet.write_table(table, tmp_path / "a.parquet")
            found = np.array(pool.submit(peaks, tmp_path).result())
    numbers = 8 * 7 * len(made)  # bytes
    assert (found < numbers * np.array([2.2, 2.2, 2.5])).all()


def test_currents_are_converted_to_torques(planar, clock, recording):
    (by_torque,) = preprocess(recording, of_file())
    currents = recorded(planar, clock, ("position", "velocity", "current"))
    (by_current,) = preprocess(currents, of_file(), (2.0, 2.0))
    np.testing.assert_allclose(by_current.torque, by_torque.torque)
    (turned,) = preprocess(currents, of_file(reverse=list(planar.joint_names[1:])), (2.0, 2.0))
    np.testing.assert_allclose(turned.torque, by_torque.torque * [1.0, -1.0])


def test_the_bandwidth_ignores_rest_and_noise(planar):
    time = np.arange(40000) * 0.005
    since = np.clip(time - 150, 0, None)
    q, _, _ = states(since)
    noise = 3e-4 * np.random.default_rng(0).standard_normal(q.shape)
    recording = Recording("waits", planar.joint_names, time, q + noise, torque=q)
    assert 0.3 < statistics_of(recording, of_file()).bandwidth < 0.7


def wave(time):
    return np.stack([np.sin(2 * time), np.cos(3 * time)], 1)


@settings(max_examples=30)
@given(st.integers(10, 380), st.integers(0, 20))
def test_the_grid_is_uniform_and_crosses_no_gap(at, duplicates):
    time = np.arange(400) * 0.01 + np.random.default_rng(0).uniform(-0.003, 0.003, 400)
    time[at:] += 1.0
    once, again = (
        [
            (run.grid(0, run.points), run.at([wave(t)], 0, run.points))
            for run in continuous_stretches(t, 0.01, 0.1)
        ]
        for t in (time, np.sort([*time, *time[:duplicates]]))
    )
    assert len(once) == len(again) == 2
    for (grid, x), (same, y), ends in zip(once, again, (time[:at], time[at:])):
        assert grid[0] == ends[0] and ends[-1] - 0.01 < grid[-1] <= ends[-1] + 1e-9
        np.testing.assert_array_equal(grid, same)
        np.testing.assert_array_equal(x, y)
        np.testing.assert_allclose(np.diff(grid), 0.01, atol=1e-12)
        np.testing.assert_allclose(x, wave(grid), atol=5e-4)
