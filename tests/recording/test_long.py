import torch

from sidegan.recording.load import Source
from sidegan.recording.segments import grid_for, preprocess
from sidegan.recording.statistics import statistics_of
from tests.recording.conftest import load_recording, of_file
from tests.recording.long import write


def test_a_long_recording_is_preprocessed_in_pieces(arm, tmp_path, monkeypatch):
    """What is held follows from the bandwidth and the duration, not from the sampling rate."""
    samples = write(arm, tmp_path / "long.parquet", 3)
    monkeypatch.setattr("sidegan.recording.segments._POINTS_AT_ONCE", 10_000)
    source = Source(tmp_path / "long.parquet", of_file(), arm.joint_names, rows=8_000)
    grid = grid_for(statistics_of(source), of_file())
    segments = preprocess(source, of_file(), grid=grid)
    kept = sum(len(segment.time) for segment in segments)
    assert samples == 48_000 and kept < samples / 5
    assert grid.rate >= 10 * grid.cutoff * 0.9
    monkeypatch.undo()
    whole = load_recording(source.path, of_file(), arm.joint_names)
    at_once = preprocess(whole, of_file(), grid=grid)
    assert len(segments) == len(at_once)
    for one, other in zip(segments, at_once):
        for a, b in zip(one, other):
            torch.testing.assert_close(a, b, atol=1e-6, rtol=0)
