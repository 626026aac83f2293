"""Loads, and gains of drives from known ones, against torques and currents that Pinocchio's dynamics need."""

import numpy as np
import pinocchio as pin
import pytest

from sidegan.errors import RecordingError
from sidegan.identification import Measurements
from sidegan.identification.payload import VALUES, Payload, drive_gains, identify_payload, values_of
from sidegan.robot import pseudo_inertia
from tests.identification.recordings import model_of, multisine, truth_of, white
from tests.oracle import chain_model, pinocchio_torque
from tests.refusals import refused

TRUE = np.array([11.0, 12.5, 9.0, 10.5, 8.0, 7.5, 6.0])  # gains [N·m/A]
MASS, CENTRE = 1.7, np.array([0.02, -0.03, 0.09])
INERTIA = np.diag([0.006, 0.005, 0.003])  # about the centre
# Parameters of loads about the last joint's frame, (10,).
LOAD = pin.Inertia(MASS, CENTRE, INERTIA).toDynamicParameters()
HEAVY = pin.Inertia(3 * MASS, CENTRE, 3 * INERTIA).toDynamicParameters()


def runs(arm, load, seed, noise, samples=1500, size=1.0):
    """Measurements with the load's torque from Pinocchio's inverse dynamics, and with friction."""
    model = model_of(arm)
    q, dq, ddq = (size * x for x in multisine(arm.joints, samples, seed))
    friction = model.torque(truth_of(model), q, dq, ddq) - model.torque(model.nominal, q, dq, ddq)
    loaded = chain_model(arm)
    if load[0] > 0:
        loaded.inertias[arm.joints] += pin.Inertia.FromDynamicParameters(load)
    torque = pinocchio_torque(loaded, q, dq, ddq) + friction
    return Measurements(q, dq, ddq, torque + noise * white(torque.shape, seed, 5))


@pytest.fixture(scope="module")
def both(arm):
    """A motion without the load, and another one with it."""
    return runs(arm, 0 * LOAD, 0, 0.3), runs(arm, LOAD, 1, 0.3)


@pytest.fixture(scope="module")
def found(arm, both):
    free, laden = both
    return identify_payload(model_of(arm), [free], [laden])


def test_the_load_is_recovered_within_its_deviations(found):
    (truth,) = values_of(LOAD[None])
    np.testing.assert_allclose(truth[:4], [MASS, *CENTRE], atol=1e-12)
    np.testing.assert_allclose(truth[[4, 6, 9]], np.diag(INERTIA), atol=1e-12)
    error = found.estimate - LOAD
    assert float(error @ np.linalg.solve(found.covariance, error)) < 40  # χ² of ten, inflated errors
    assert found.certain and found.link == "link_7" and len(VALUES) == 10
    assert abs(found.values[0] - MASS) < 4 * found.deviation[0] < 0.3
    assert (abs(found.values[1:4] - CENTRE) < 4 * found.deviation[1:4] + 1e-3).all()
    assert (found.explained[:4] < 0.1 * found.without[:4]).all()


def test_deviations_follow_by_finite_differences():
    """Of correlated errors, through the ratios that centre and inertia are."""
    spread = white((10, 10), 2) / 100
    found = Payload("hand", LOAD, spread @ spread.T, LOAD, np.ones(7), np.ones(7))
    step = 1e-6
    slope = (values_of(LOAD + step * np.eye(10)) - values_of(LOAD - step * np.eye(10))).T / (2 * step)
    np.testing.assert_allclose(found.deviation, np.linalg.norm(slope @ spread, axis=1), rtol=1e-8)


def test_the_identified_load_is_physical_despite_noise(arm):
    """A motion so small that least squares gives a body that cannot exist."""
    free, laden = (runs(arm, x, seed, 3.0, 300, 0.3) for seed, x in enumerate((0 * LOAD, LOAD)))
    found = identify_payload(model_of(arm), [free], [laden])
    assert np.linalg.eigvalsh(pseudo_inertia(found.estimate))[0] < 0
    assert np.linalg.eigvalsh(pseudo_inertia(found.body))[0] > 0


def test_sensors_may_be_tared_between_the_runs(arm, both, found):
    free, laden = both
    tared = Measurements(*laden.states, laden.torque + np.linspace(-3, 3, arm.joints))
    again = identify_payload(model_of(arm), [free], [tared])
    np.testing.assert_allclose(again.estimate, found.estimate, atol=1e-3)
    assert abs(again.values[0] - MASS) < 4 * again.deviation[0] < 0.3


def test_exchanged_runs_are_refused(arm, both):
    free, laden = both
    with refused(RecordingError, "-1.", "loaded"):
        identify_payload(model_of(arm), [laden], [free])


def test_no_load_is_identified_as_none(arm, both):
    found = identify_payload(model_of(arm), [both[0]], [runs(arm, 0 * LOAD, 1, 0.3)])
    assert not found.certain and float(found.values[0]) < 0.1


def currents(arm, load, seed, noise=0.02):
    """Measurements whose torque is a noisy current [A]."""
    data = runs(arm, load, seed, 0.0)
    return Measurements(*data.states, data.torque / TRUE + noise * white(data.torque.shape, seed))


@pytest.fixture(scope="module")
def driven(arm):
    """Currents of a motion without the load, and of another one with it."""
    return currents(arm, 0 * HEAVY, 0), currents(arm, HEAVY, 1)


def test_gains_are_recovered_within_their_deviations(arm, driven):
    free, laden = driven
    found = drive_gains(model_of(arm), [free], [laden], HEAVY)
    assert (np.abs(found.gains - TRUE) < 4 * found.deviation + 1e-3 * TRUE).all()
    assert (found.deviation < 0.05 * TRUE).all()
    assert found.certain.all() and not found.doubts(arm)


def test_a_load_that_the_currents_do_not_show_is_refused(arm, driven):
    again = currents(arm, 0 * HEAVY, 10)
    with refused(RecordingError, "currents", "loaded"):
        drive_gains(model_of(arm), [driven[0]], [again], HEAVY)


def test_an_uncertain_gain_is_reported(arm):
    free, laden = currents(arm, 0 * HEAVY, 0, 2.0), currents(arm, HEAVY, 1, 2.0)
    found = drive_gains(model_of(arm), [free], [laden], HEAVY)
    (doubt,) = found.doubts(arm)
    assert found.certain.tolist() == [True, True, True, True, False, True, False]
    assert "joint_5, joint_7" in doubt and "20%" in doubt


NONE, FOURTH, ALL = [], [3], [*range(7)]
TURN_4, TURN_ALL = "('recording.reverse=[joint_4]')", "('recording.reverse=[joint_1, joint_2, "
SIGNS = [  # reversed currents, those against the description, whether runs are exchanged; what is named
    (FOURTH, FOURTH, False, "gain of joint_4 is negative", TURN_4),
    (FOURTH, NONE, False, "gain of joint_4 is negative"),
    (ALL, ALL, False, "joint_7 is negative", TURN_ALL),
    (NONE, NONE, True, "joint_1, ", "recordings and loaded exchanged?"),
    (FOURTH, FOURTH, True, "joint_7 change", "recordings and loaded exchanged?", TURN_4),
    (FOURTH, NONE, True, "recordings and loaded exchanged?", TURN_4),
    (ALL, ALL[:-1], True, "joint_6 change", "('recording.reverse=[joint_1, "),
    (NONE, FOURTH, False, "joint_4 shows", "load.centre"),
]


@pytest.mark.parametrize("case", SIGNS)
def test_reversed_currents_and_exchanged_runs_are_told_apart(arm, driven, case):
    turned, against, exchanged, *names = case
    marks, opposite = np.isin(ALL, turned), np.isin(ALL, against)
    data = [[Measurements(*x.states, np.where(marks, -1, 1) * x.torque)] for x in driven]
    found = drive_gains(model_of(arm), *data[:: -1 if exchanged else 1], HEAVY, opposite)
    assert found.exchanged == exchanged and found.certain.dtype == bool
    assert found.certain.tolist() == (~marks & ~opposite & (not exchanged)).tolist()
    (doubt,) = found.doubts(arm)
    assert not [name for name in names if name not in doubt], doubt
