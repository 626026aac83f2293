"""From checked recordings to an identified arm and its tests, by every method."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import RecordingError
from sidegan.identification import EstimationSettings, Terms
from sidegan.identification.identified import CONSISTENT
from sidegan.identification.verdict import BAD
from sidegan.identification.workflow import identify_arm, preferred
from sidegan.recording.check import check_recording
from sidegan.report.identification.content import advice
from tests.recording.conftest import moved, of_file

VISCOUS, COULOMB = np.array([2.0, 0.8]), np.array([1.0, 0.4])


def checked(truth, arm, seed):
    """A recording of a quarter of a minute at 200 Hz of a true arm, checked against a description."""
    time, generator = np.arange(15 * 200) / 200, np.random.default_rng(seed)
    return check_recording(moved(truth, time, VISCOUS, COULOMB, generator), arm, of_file())


@pytest.fixture(scope="module")
def recordings(planar):
    return [checked(planar, planar, seed) for seed in range(3)]


def identified(arm, training, validation=(), method="weighted", **others):
    terms = Terms(sign_width=0.01)
    options = EstimationSettings(method=method, **others)
    return identify_arm(arm, list(training), list(validation), terms, options)


@pytest.mark.parametrize("method", ["weighted", "ols"])
def test_every_method_identifies(planar, recordings, method):
    result = identified(planar, recordings[:1], recordings[1:2], method)
    assert result.chosen.method == method and result.tests.kind == "held out"
    assert list(result.tests.errors) == list(dict.fromkeys([method, "ols", "consistent"]))
    assert result.tests.errors[method].nmse.mean() < 5e-3
    assert result.use == CONSISTENT
    assert result.links.shape == (2, 10)


def test_without_validation_recordings_take_turns(planar, recordings):
    result = identified(planar, recordings)
    assert result.tests.kind == "each of 3 recordings, predicted from the others"
    assert result.tests.errors["weighted"].nmse.mean() < 2e-3
    assert result.quality.folds is not None


def test_one_recording_is_tested_on_itself_and_that_is_stated(planar, recordings):
    result = identified(planar, recordings[:1])
    assert result.tests.errors["weighted"].nmse.mean() < 2e-3
    assert result.tests.kind.startswith("in sample") and result.tests.errors is result.trained
    assert any("held out" in reason for reason in result.quality.reasons)


def test_fewer_equations_than_parameters_are_refused(planar, recordings):
    segment = recordings[0].segments[0]
    short = replace(recordings[0], segments=[type(segment)(*(x[:2] for x in segment))])
    with pytest.raises(RecordingError, match="2 samples of 2 joints are left, too few for"):
        identified(planar, [short])


def test_a_model_that_can_exist_is_preferred_unless_another_is_clearly_better():
    errors = np.array([0.1, 0.01, 1e-3])
    assert preferred("weighted", {"weighted": errors, CONSISTENT: 1.09 * errors}) == CONSISTENT
    assert preferred("weighted", {"weighted": errors, CONSISTENT: 1.11 * errors}) == "weighted"
    one_joint = np.array([1.25, 0.95, 0.95]) * errors  # decides the mean, and nothing else
    assert preferred("weighted", {"weighted": errors, CONSISTENT: one_joint}) == CONSISTENT
    assert preferred("weighted", {}) == CONSISTENT


@pytest.mark.parametrize("validated", [True, False])
def test_the_model_to_use_predicts_better(planar, validated):
    """The true arm's second link has a moment of inertia below zero."""
    links = planar.inertial_parameters.copy()
    links[1, 4:] *= -2
    strange = [checked(replace(planar, inertial_parameters=links), planar, seed) for seed in (0, 1)]
    result = identified(planar, strange[:1], strange[1:] if validated else [])
    assert result.use == "weighted" and (result.choice.kind == result.tests.kind) == validated
    assert result.choice.errors["weighted"].mean() < result.choice.errors[CONSISTENT].mean() / 1.1
    assert f"{result.choice.errors[CONSISTENT].mean():.4f}" in advice(result)
    assert result.quality.judged is (result.tests.errors if validated else result.trained)["weighted"]
    used = result.used_standard
    np.testing.assert_allclose(result.model.mapping @ used, result.estimates["weighted"].parameters)
    assert not np.allclose(used, result.standard)


def test_halves_without_information_decide_nothing(planar, recordings):
    """In the first of two halves the torques do not change: no error of them is defined."""
    segment = type(recordings[0].segments[0])(*(x[:40] for x in recordings[0].segments[0]))
    torque = segment.torque.copy()
    torque[:20] = torque[0]
    short = replace(recordings[0], segments=[segment._replace(torque=torque)])
    result = identified(planar, [short])
    assert result.use == CONSISTENT and result.choice.errors == {}
    assert result.quality.verdict == BAD and advice(result).startswith("Use none")
    better = identified(planar, recordings[:1])
    better = replace(better, choice=replace(better.choice, errors={}))
    assert "hold too little to predict each other" in advice(better)
