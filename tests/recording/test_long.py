import torch

from sidegan.recording import Columns, Source, condition, grid_for, survey
from sidegan.recording.settings import Settings
from tests.recording.long import write


def test_a_long_recording_is_conditioned_in_pieces(arm, tmp_path):
    """What is held follows from the bandwidth and the duration, not from the sampling rate."""
    samples = write(arm, tmp_path / "long.parquet", 8)
    source = Source(tmp_path / "long.parquet", Columns(), arm.joint_names, rows=20_000)
    grid = grid_for(survey(source), Settings())
    segments = condition(source, grid=grid)
    kept = sum(len(segment.time) for segment in segments)
    assert samples > 100_000 and kept < samples / 5
    assert grid.rate >= 10 * grid.cutoff * 0.9
    at_once = condition(next(iter(Source(source.path, Columns(), arm.joint_names, rows=10**6))), grid=grid)
    assert len(segments) == len(at_once)
    for one, other in zip(segments, at_once):
        for a, b in zip(one, other):
            torch.testing.assert_close(a, b, atol=1e-6, rtol=0)
