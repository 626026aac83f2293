"""LeRobot datasets of both versions, written as their documentation describes them."""

import json
from itertools import pairwise

import numpy as np
import pandas as pd
import pytest
import yaml

from sidegan.base.conf import CONF
from sidegan.errors import RecordingError
from sidegan.recording.load import files_of
from tests.recording.conftest import recorded
from tests.recording.files import load
from tests.refusals import refused

FPS, CUTS = 100, (0, 700, 1200, 2000)  # frames at which episodes begin


def read(folder):
    settings = yaml.safe_load((CONF / "recording" / "lerobot.yaml").read_text(encoding="utf-8"))
    del settings["defaults"]
    return load(folder, **settings)


@pytest.fixture
def made(planar):
    return recorded(planar, np.arange(CUTS[-1]) / FPS)


def written(made, folder, version="v3.0", named=True):
    """A dataset of three episodes, of which each joint's signals are in one vector; or vectors."""
    vectors, names = {"observation.state": made.position, "observation.effort": made.torque}, None
    if named:
        gripper = np.zeros((len(made), 1))
        vectors = {"observation.state": np.concatenate([made.position, gripper, made.torque, gripper], 1)}
        names = [f"{joint}.{kind}" for kind in ("pos", "effort") for joint in (*made.joint_names, "gripper")]
        names = {"motors": names} if version == "v2.1" else names
    about = {name: {"shape": [x.shape[1]], "names": names} for name, x in vectors.items()}
    columns = {name: [*x] for name, x in {**vectors, "action": made.position}.items()}
    columns["timestamp"] = np.concatenate(
        [np.arange(b - a) / FPS for a, b in pairwise(CUTS)], dtype=np.float32
    )
    columns["episode_index"] = np.repeat(np.arange(3), np.diff(CUTS))
    ends = [*pairwise(CUTS)] if version == "v2.1" else [(0, CUTS[2]), CUTS[2:]]
    (folder / "data" / "chunk-000").mkdir(parents=True)
    for k, (a, b) in enumerate(ends):
        pd.DataFrame(columns)[a:b].to_parquet(folder / "data" / "chunk-000" / f"file-{k:03d}.parquet")
    (folder / "meta").mkdir()
    (folder / "meta" / "info.json").write_text(json.dumps({"codebase_version": version, "features": about}))
    return folder


@pytest.mark.parametrize("version", ["v2.1", "v3.0"])
@pytest.mark.parametrize("named", [True, False])
def test_both_versions_are_read(made, tmp_path, version, named):
    folder = written(made, tmp_path / "set", version, named)
    assert len(files_of(folder)) == (4 if version == "v2.1" else 3)
    loaded = read(folder)
    assert set(loaded.signals()) == {"position", "torque"}
    for name in loaded.signals():
        np.testing.assert_allclose(getattr(loaded, name), getattr(made, name), rtol=1e-6, atol=1e-6)
    steps = np.full(len(made) - 1, 1 / FPS)
    steps[np.array(CUTS[1:-1]) - 1] = 10.0
    np.testing.assert_allclose(np.diff(loaded.time), steps, atol=1e-5)


def test_an_incomplete_dataset_is_refused(made, tmp_path):
    folder = written(made, tmp_path / "set")
    first, second = sorted(folder.glob("data/*/*.parquet"))
    second.unlink()
    first.unlink()
    with refused(RecordingError, str(folder), ".parquet"):
        read(folder)
    pd.DataFrame({"timestamp": [0.0]}).to_parquet(first)
    with refused(RecordingError, str(first), "episode_index"):
        read(folder)
    (folder / "meta" / "info.json").write_text("{")
    with refused(RecordingError, "info.json"):
        read(folder)
