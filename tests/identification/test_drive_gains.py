"""Gains of drives, against currents that Pinocchio's torques would need."""

import numpy as np
import pinocchio as pin
import pytest

from sidegan.errors import RecordingError
from sidegan.identification import Measurements
from sidegan.identification.payload import drive_gains
from tests.identification.recordings import model_of, white
from tests.identification.test_payload import CENTRE, INERTIA, MASS, runs

TRUE = np.array([11.0, 12.5, 9.0, 10.5, 8.0, 7.5, 6.0])  # N·m/A


@pytest.fixture(scope="module")
def load():
    return pin.Inertia(3 * MASS, CENTRE, 3 * INERTIA).toDynamicParameters()


def currents(arm, load, seed, noise=0.02):
    """Measurements whose torque is a noisy current [A]."""
    data = runs(arm, load, seed, 0.0)
    return Measurements(*data.states, data.torque / TRUE + noise * white(data.torque.shape, seed))


@pytest.fixture(scope="module")
def both(arm, load):
    """Currents of a motion without the load, and of another one with it."""
    return currents(arm, 0 * load, 0), currents(arm, load, 1)


def test_gains_are_recovered_within_their_deviations(arm, load, both):
    free, laden = both
    found = drive_gains(model_of(arm), [free], [laden], load)
    assert (np.abs(found.gains - TRUE) < 4 * found.deviation + 1e-3 * TRUE).all()
    assert (found.deviation < 0.05 * TRUE).all()
    assert found.certain.all() and not found.doubts(arm)


def test_a_load_that_the_currents_do_not_show_is_refused(arm, load, both):
    again = currents(arm, 0 * load, 10)
    with pytest.raises(RecordingError, match=r"the currents do not show the load: its effect .* in loaded"):
        drive_gains(model_of(arm), [both[0]], [again], load)


def test_an_uncertain_gain_is_reported(arm, load):
    free, laden = currents(arm, 0 * load, 0, 2.0), currents(arm, load, 1, 2.0)
    found = drive_gains(model_of(arm), [free], [laden], load)
    (doubt,) = found.doubts(arm)
    assert found.certain.tolist() == [True, True, True, True, False, True, False]
    assert (
        "the current of joint_5, joint_7 hardly shows the load: σ of the gain is more than 20% of it" in doubt
    )


NONE, ALL = [], [*range(7)]
REVERSED = "(recording.reverse=["
SIGNS = {  # reversed currents, those against the description, whether runs are exchanged; what is said
    "one reversed": ([3], [3], False, ["gain of joint_4 is negative", f"{REVERSED}joint_4])"]),
    "one reversed, without a description": ([3], NONE, False, ["gain of joint_4 is negative"]),
    "all reversed": (ALL, ALL, False, ["joint_7 is negative", f"{REVERSED}joint_1,"]),
    "exchanged": (NONE, NONE, True, ["joint_1, ", "joint_7 change as if", "loaded exchanged?"]),
    "exchanged, one reversed": (
        [3],
        [3],
        True,
        [
            "joint_7 change as if",
            f"exchanged? If so, signs of currents are reversed, too {REVERSED}joint_4])",
        ],
    ),
    "exchanged, one reversed, without a description": (
        [3],
        NONE,
        True,
        ["exchanged?", f"{REVERSED}joint_4])"],
    ),
    "exchanged, all reversed": (ALL, ALL[:-1], True, ["joint_6 change as if", f"{REVERSED}joint_1,"]),
    "another description": (
        NONE,
        [3],
        False,
        ["joint_4 shows the load with the right sign but runs against"],
    ),
}


@pytest.mark.parametrize(("turned", "against", "exchanged", "said"), SIGNS.values(), ids=SIGNS)
def test_reversed_currents_and_exchanged_runs_are_told_apart(
    arm, load, both, turned, against, exchanged, said
):
    marks, opposite = (np.isin(ALL, joints) for joints in (turned, against))
    data = [[Measurements(*x.states, np.where(marks, -1, 1) * x.torque)] for x in both]
    found = drive_gains(model_of(arm), *data[:: -1 if exchanged else 1], load, opposite)
    assert found.exchanged == exchanged and found.certain.dtype == bool
    assert found.certain.tolist() == (~marks & ~opposite & (not exchanged)).tolist()
    (doubt,) = found.doubts(arm)
    assert all(words in doubt for words in said)
