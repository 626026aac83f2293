"""Recordings of a real arm, where they are at hand: trained on one, tested on another."""

import pytest

from sidegan.identification import Measurements, score
from sidegan.identification.lacking import lacks
from sidegan.recording.segments import preprocess
from sidegan.robot import load_robot
from tests.identification.recordings import fitted, model_of
from tests.recording.conftest import load_recording, of_file, real

GAINS = (14.87, 13.26, 11.13, 10.62, 11.03, 11.47)  # [N·m/A] of the UR10e


def measured(name, arm, gains=None, **changes):
    """A recording as it is identified from."""
    recording = load_recording(real(name), of_file(**changes), arm.joint_names)
    (segment,) = preprocess(recording, of_file(**changes), gains)
    return Measurements(*segment[1:])


@pytest.fixture(scope="module")
def ur10e_model():
    return model_of(load_robot(real("ur10e/reference.urdf")))


@pytest.fixture(scope="module")
def ur10e_runs(ur10e_model):
    names = ("ur10e/recorded_20s8h.csv", "ur10e/recorded_20s10h.csv")
    return [measured(name, ur10e_model.arm, GAINS, cutoff=5.0) for name in names]


@pytest.mark.parametrize("train", [0, 1])
@pytest.mark.parametrize(
    ("method", "most"),
    [("ols", 0.018), *((name, 0.008) for name in ("weighted", "huber", "essential", "consistent"))],
)
def test_ur10e_predicts_the_other_recording(ur10e_model, ur10e_runs, method, most, train):
    found = fitted(method, ur10e_model, ur10e_runs[train])
    assert score(ur10e_model, found.parameters, ur10e_runs[1 - train]).nmse_mean <= most


def test_ur10e_shows_friction_that_grows_with_the_load(ur10e_model, ur10e_runs):
    """At the joints that carry the arm, in both recordings, most of what is left."""
    for run in ur10e_runs:
        found = lacks(ur10e_model, fitted("weighted", ur10e_model, run), run)
        first = {j: found.of(j)[0] for j in (1, 2)}
        assert all(one.kind.name == "friction that grows with the load" for one in first.values())
        assert first[1].share > 0.5 and first[2].share > 0.35
