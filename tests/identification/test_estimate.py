import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.identification import METHODS, estimate
from tests.identification import recordings
from tests.identification.recordings import Fixed, assert_close, model_of, noisy_rows, recorded, truth_of

PLAIN = ["ols", "weighted"]  # need no arm, and scale with the torque


@pytest.fixture(scope="module")
def rows():
    return noisy_rows(400)


def fitted(method, rows, **settings):
    model = Fixed(rows[0])
    return estimate(method, model, model.measurements(rows[1]), **settings)


def test_condition_is_that_of_scaled_columns(rows):
    found = fitted("weighted", rows)
    y = (rows[0] * found.weights[:, None]).reshape(-1, 6)
    assert found.condition == pytest.approx(np.linalg.cond(y / np.linalg.norm(y, axis=0)), rel=1e-6)


class TestLaws:
    @pytest.mark.parametrize("method", METHODS)
    def test_exact_torques_give_the_true_parameters(self, planar, method):
        model = model_of(planar)
        found = estimate(method, model, recorded(model, 600))
        tolerance = 2e-3 if method == "consistent" else 1e-4
        scale = np.maximum(np.abs(truth_of(model)), 0.1)
        assert (np.abs(found.parameters - truth_of(model)) / scale).max() < tolerance

    @settings(max_examples=25, deadline=None)
    @given(st.sampled_from([0.02, 0.5, 7.0, 100.0]), st.integers(0, 1000), st.sampled_from(PLAIN))
    def test_parameters_go_with_what_is_added_and_scaled(self, rows, factor, seed, method):
        shift = np.random.default_rng(seed).normal(size=6)
        one = fitted(method, rows, prior=1e12)
        other = fitted(method, (rows[0], factor * rows[1] + rows[0] @ shift), prior=1e12)
        assert_close(other.parameters, factor * one.parameters + shift, 1e-6)
        assert_close(other.deviation, factor * one.deviation, 1e-2)

    @settings(max_examples=20, deadline=None)
    @given(st.integers(1, 500), st.integers(1, 399), st.sampled_from(PLAIN))
    def test_neither_pieces_nor_recordings_matter(self, rows, size, cut, method):
        model = Fixed(rows[0])
        data = model.measurements(rows[1])
        whole = estimate(method, model, data)
        with recordings.at_once(size):
            found = estimate(method, model, iter([data[:cut], data[cut:]]))
        assert_close(found.parameters, whole.parameters, 1e-8)
        assert found.samples == 400
