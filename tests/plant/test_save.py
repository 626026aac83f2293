"""Recordings of the plant as files, which go through the same door as real ones."""

import pytest
import torch

from sidegan.plant import Plant, save_recording
from tests.recording.conftest import load_recording, of_file


@pytest.mark.parametrize("suffix", [".csv", ".parquet"])
def test_every_number_comes_back_through_the_door_of_recordings(planar, motions, standard, tmp_path, suffix):
    executed = Plant(planar, standard).execute(motions(planar, period=1.0), 0)
    path = tmp_path / f"plant{suffix}"
    save_recording(executed, planar.joint_names, path)
    read = load_recording(path, of_file(), planar.joint_names)
    assert not read.corrupt and read.acceleration is None
    for name, values in executed._asdict().items():
        assert torch.equal(getattr(read, name), values), name
