"""From checked recordings to an identified arm and its tests, by every method."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import RecordingError
from sidegan.identification.estimate import Score
from sidegan.identification.identified import CONSISTENT
from sidegan.identification.workflow import preferred
from sidegan.report.identification.content import advice
from tests.identification.recordings import checked, identified


@pytest.fixture(scope="module")
def recordings(planar):
    return [checked(planar, seed) for seed in range(3)]


@pytest.mark.parametrize("method", ["weighted", "ols"])
def test_every_method_identifies(planar, recordings, method):
    result = identified(planar, recordings[:1], recordings[1:2], method)
    assert result.chosen.method == method and result.kind == "held out"
    assert list(result.tested) == list(dict.fromkeys([method, "ols", "consistent"]))
    assert result.tested[method].nmse.mean() < 5e-3
    assert result.use == CONSISTENT
    assert result.links.shape == (2, 10)


def test_without_validation_recordings_are_cross_validated(planar, recordings):
    result = identified(planar, recordings)
    assert result.kind == "each of 3 recordings, predicted from the others"
    assert result.tested["weighted"].nmse.mean() < 2e-3
    assert result.quality.held_out is result.tested["consistent"]


def test_a_single_recording_is_tested_in_sample_and_says_so(planar, recordings):
    result = identified(planar, recordings[:1])
    assert result.tested["weighted"].nmse.mean() < 2e-3
    assert result.kind.startswith("in sample") and result.tested is result.trained
    assert any("held out" in reason for reason in result.quality.reasons)
    assert result.use == CONSISTENT and "nothing was held out to compare" in advice(result)


def test_fewer_equations_than_parameters_are_refused(planar, recordings):
    segment = recordings[0].segments[0]
    short = replace(recordings[0], segments=[type(segment)(*(x[:2] for x in segment))])
    with pytest.raises(RecordingError, match="2 samples of 2 joints are left, too few for"):
        identified(planar, [short])


def test_the_consistent_model_is_preferred_unless_clearly_worse():
    errors = np.array([0.1, 0.01, 1e-3])
    one_joint = np.array([1.25, 0.95, 0.95])  # decides the mean, and nothing else
    for factor, use in ((1.09, CONSISTENT), (1.11, "weighted"), (one_joint, CONSISTENT)):
        tested = {"weighted": Score(errors, errors), CONSISTENT: Score(factor * errors, errors)}
        assert preferred("weighted", tested) == use


def test_the_weighted_model_is_used_if_it_predicts_better(planar):
    """The true arm's second link has a moment of inertia below zero."""
    links = planar.inertial_parameters.copy()
    links[1, 4:] *= -2
    strange = [checked(planar, seed, replace(planar, inertial_parameters=links)) for seed in (0, 1)]
    result = identified(planar, strange[:1], strange[1:])
    errors = {method: score.nmse_mean for method, score in result.tested.items()}
    assert result.use == "weighted" and errors["weighted"] < errors[CONSISTENT] / 1.1
    assert f"{errors[CONSISTENT]:.4f}" in advice(result)
    assert result.quality.judged is result.tested["weighted"]
    used = result.used_standard
    np.testing.assert_allclose(result.model.mapping @ used, result.estimates["weighted"].parameters)
    assert not np.allclose(used, result.standard)
