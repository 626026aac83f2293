"""Recordings of real arms, where they are at hand: trained on one, tested on another."""

import os
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
import torch
from scipy.signal import butter, sosfiltfilt

from sidegan.identification import Measurements, estimate, score, trust
from sidegan.identification.lacking import lacks
from sidegan.robot import load_robot
from tests.identification.recordings import fitted, model_of

DATA = Path(os.environ.get("SIDEGAN_DATA", Path(__file__).parents[3] / "shared" / "data"))
GAINS = np.array([14.87, 13.26, 11.13, 10.62, 11.03, 11.47])  # [N·m/A] of the UR10e
SIGN_WIDTH = 0.01  # [rad/s]

pytestmark = pytest.mark.skipif(not DATA.is_dir(), reason=f"there are no recordings in {DATA}")


def columns(frame, name, joints):
    return frame[[f"{name}{j + 1}" for j in range(joints)]].to_numpy()


def measured(position, velocity, acceleration, torque, low_pass):
    sign = low_pass(np.tanh(velocity / SIGN_WIDTH))
    arrays = (position, velocity, acceleration, torque, sign)
    return Measurements(*(torch.from_numpy(np.ascontiguousarray(x)) for x in arrays))


def ur10e(name):
    """A recording resampled to 100 Hz and low-passed at 5 Hz."""
    frame = pd.read_csv(DATA / "ur10e" / f"{name}.csv")
    grid = np.arange(frame.t.iloc[0], frame.t.iloc[-1], 0.01)
    filters = butter(4, 0.1, output="sos")

    def low_pass(x):
        return sosfiltfilt(filters, x, axis=0)

    def signal(column):
        raw = columns(frame, column, 6)
        return low_pass(np.stack([np.interp(grid, frame.t, raw[:, j]) for j in range(6)], 1))

    velocity = signal("qd")
    acceleration = low_pass(np.gradient(velocity, 0.01, axis=0))
    return measured(signal("q"), velocity, acceleration, signal("i") * GAINS, low_pass)


@pytest.fixture(scope="module")
def ur10e_model():
    return model_of(load_robot(DATA / "ur10e" / "reference.urdf"))


@pytest.fixture(scope="module")
def ur10e_runs():
    return [ur10e("recorded_20s8h"), ur10e("recorded_20s10h")]


@pytest.mark.parametrize("train", [0, 1])
@pytest.mark.parametrize(
    ("method", "most"),
    [
        ("ols", 0.018),
        ("weighted", 0.008),
        ("huber", 0.008),
        ("essential", 0.008),
        ("consistent", 0.008),
    ],
)
def test_ur10e_predicts_the_other_recording(ur10e_model, ur10e_runs, method, most, train):
    found = fitted(method, ur10e_model, ur10e_runs[train])
    assert score(ur10e_model, found.parameters, ur10e_runs[1 - train]).nmse_mean <= most


def test_ur10e_is_trusted(ur10e_model, ur10e_runs):
    found = estimate("weighted", ur10e_model, ur10e_runs[0])
    result = trust(ur10e_model, found, ur10e_runs[1:])
    assert result.verdict == "good"
    assert result.estimate.condition < 20 and not result.weak


def test_ur10e_shows_friction_that_grows_with_the_load(ur10e_model, ur10e_runs):
    """At the joints that carry the arm, in both recordings, most of what is left."""
    for run in ur10e_runs:
        found = lacks(ur10e_model, fitted("weighted", ur10e_model, run), run)
        first = {j: found.of(j)[0] for j in (1, 2)}
        assert all(one.kind.name == "friction that grows with the load" for one in first.values())
        assert first[1].share > 0.5 and first[2].share > 0.35


def test_lwr_is_poorly_excited_and_says_so(arm):
    frame = pd.read_csv(DATA / "kuka_lwr4" / "recorded_hw1_50hz.csv")
    filters = butter(4, 2 / 25, output="sos")  # 2 Hz, which the torques went through already

    def low_pass(x):
        return sosfiltfilt(filters, x, axis=0)

    signals = [low_pass(columns(frame, name, 7)) for name in ("q", "qd", "qdd", "tau")]
    data = measured(*signals, low_pass)[25:-25]
    model = model_of(arm)
    found = estimate("weighted", model, data)
    result = trust(model, found)
    assert (result.train.nmse[:4] <= 0.02).all()
    assert result.verdict == "not trustworthy"
    assert any("poorly excited" in reason for reason in result.reasons)
    assert any("joint 6" in reason and "not identifiable" in reason for reason in result.reasons)
    assert len(result.weak) > 10
