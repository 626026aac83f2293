"""LeRobot datasets of both versions, written as their documentation describes them."""

import json
from itertools import pairwise

import numpy as np
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import torch

from sidegan.errors import RecordingError
from sidegan.recording.check import check_recording
from sidegan.recording.load import Source, files_of
from sidegan.recording.settings import RecordingSettings
from tests.recording.conftest import load_recording, recorded
from tests.settings import settings

FPS, CUTS = 100, (0, 700, 1200, 2000)  # frames at which episodes begin
SIGNALS = {"pos": "position", "effort": "torque"}


def of_dataset(**changes):
    return settings(RecordingSettings, "recording/lerobot", **changes)


@pytest.fixture
def made(planar):
    return recorded(planar, np.arange(CUTS[-1]) / FPS)


def written(made, folder, version, named=True):
    """A dataset of three episodes, of which each joint's signals are in one vector; or vectors."""
    joints = [*made.joint_names, "gripper"]
    gripper = torch.zeros(len(made), 1)
    both = {kind: torch.cat([getattr(made, name), gripper], 1) for kind, name in SIGNALS.items()}
    if named:
        names = [f"{joint}.{kind}" for kind in SIGNALS for joint in joints]
        vectors, about = {"observation.state": torch.cat([*both.values()], 1)}, {"observation.state": names}
        names = {"motors": names} if version == "v2.1" else names
        about = {"observation.state": {"dtype": "float32", "shape": [len(joints) * 2], "names": names}}
    else:
        vectors = {"observation.state": made.position, "observation.effort": made.torque}
        about = {name: {"dtype": "float32", "shape": [2], "names": None} for name in vectors}
    vectors["action"] = made.position
    about |= {"timestamp": {"dtype": "float32", "shape": [1], "names": None}}
    frames = np.concatenate([np.arange(b - a) for a, b in pairwise(CUTS)])
    episodes = np.repeat(np.arange(len(CUTS) - 1), np.diff(CUTS))
    columns = {
        name: pa.array(x.numpy().astype(np.float32).tolist(), pa.list_(pa.float32()))
        for name, x in vectors.items()
    }
    columns |= {"timestamp": pa.array((frames / FPS).astype(np.float32)), "frame_index": pa.array(frames)}
    table = pa.table(columns | {"episode_index": pa.array(episodes), "index": pa.array(np.arange(len(made)))})
    data = folder / "data" / "chunk-000"
    data.mkdir(parents=True)
    if version == "v2.1":
        for k, (a, b) in enumerate(pairwise(CUTS)):
            pq.write_table(table.slice(a, b - a), data / f"episode_{k:06d}.parquet")
    else:
        pq.write_table(table.slice(0, CUTS[2]), data / "file-000.parquet")
        pq.write_table(table.slice(CUTS[2]), data / "file-001.parquet")
    (folder / "meta").mkdir()
    info = {"codebase_version": version, "fps": FPS, "features": about}
    (folder / "meta" / "info.json").write_text(json.dumps(info))
    return folder


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
@pytest.mark.parametrize("named", [True, False])
def test_both_versions_are_read(made, tmp_path, version, named):
    folder = written(made, tmp_path / "set", version, named)
    loaded = load_recording(folder, of_dataset(), made.joint_names)
    assert set(loaded.signals()) == {"position", "torque"}
    for name in SIGNALS.values():
        torch.testing.assert_close(getattr(loaded, name), getattr(made, name), rtol=1e-6, atol=1e-6)
    steps = loaded.time.diff()
    breaks = torch.nonzero(steps > 1)[:, 0].tolist()
    assert [k + 1 for k in breaks] == [*CUTS[1:-1]] and steps[breaks].tolist() == pytest.approx([10.0, 10.0])
    assert steps[steps < 1].tolist() == pytest.approx([1 / FPS] * (len(made) - 3), abs=1e-5)
    parts = list(Source(folder, of_dataset(), made.joint_names, rows=300))
    torch.testing.assert_close(torch.cat([part.time for part in parts]), loaded.time)


def test_episodes_are_stretches_of_the_check(made, planar, tmp_path):
    folder = written(made, tmp_path / "set", "v3.0")
    checked = check_recording(Source(folder, of_dataset(), made.joint_names), planar, of_dataset())
    assert len(checked.segments) == 3 and checked.statistics.step == pytest.approx(1 / FPS)
    assert [one.name for one in files_of(folder)] == ["info.json", "file-000.parquet", "file-001.parquet"]


def test_joints_of_other_names_are_said(made, tmp_path):
    folder = written(made, tmp_path / "set", "v3.0")
    with pytest.raises(RecordingError, match="no position of 2 of the arm's 2"):
        load_recording(folder, of_dataset(), ("a", "b"))
    loaded = load_recording(folder, of_dataset(joints=list(made.joint_names)), ("a", "b"))
    torch.testing.assert_close(loaded.torque, made.torque, rtol=1e-6, atol=1e-6)


def test_what_is_no_dataset_is_refused(made, tmp_path):
    folder = written(made, tmp_path / "set", "v3.0")
    first, second = sorted(folder.glob("data/*/*.parquet"))
    second.unlink()
    for words, fault in (
        ("a LeRobot dataset without frames", first.unlink),
        ("no column episode_index", lambda: pq.write_table(pa.table({"timestamp": [0.0, 1.0]}), first)),
        ("is not a whole JSON file", lambda: (folder / "meta" / "info.json").write_text("{")),
    ):
        fault()
        with pytest.raises(RecordingError, match=words):
            load_recording(folder, of_dataset(), made.joint_names)
