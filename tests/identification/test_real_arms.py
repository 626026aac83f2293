"""Recordings of a real arm, where they are at hand."""

import pytest

from sidegan.identification import Measurements
from sidegan.identification.lacking import lacks
from sidegan.recording.segments import preprocess
from sidegan.robot import load_robot
from tests.identification.recordings import fitted, model_of
from tests.recording.conftest import load_recording, of_file, real

GAINS = (14.87, 13.26, 11.13, 10.62, 11.03, 11.47)  # [N·m/A] of the UR10e


@pytest.fixture(scope="module")
def ur10e():
    """A model of it and two recordings."""
    model = model_of(load_robot(real("ur10e/reference.urdf")))
    names = ("ur10e/recorded_20s8h.csv", "ur10e/recorded_20s10h.csv")
    options = of_file(cutoff=5.0)
    recordings = (load_recording(real(name), options, model.arm.joint_names) for name in names)
    return model, [Measurements(*preprocess(one, options, GAINS)[0][1:]) for one in recordings]


def test_ur10e_shows_friction_that_grows_with_the_load(ur10e):
    """At the joints that carry the arm, in both recordings, most of what is left."""
    model, runs = ur10e
    for run in runs:
        found = lacks(model, fitted("weighted", model, run), run)
        first = {j: found.of(j)[0] for j in (1, 2)}
        assert all(one.kind.name == "friction that grows with the load" for one in first.values())
        assert first[1].share > 0.5 and first[2].share > 0.35
