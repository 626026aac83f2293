"""What estimates say of parameters and of their own errors: laws, and the errors that are made."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from sidegan.base.arrays import split
from sidegan.identification.estimate import METHODS, estimate
from sidegan.identification.fit import inflation_of
from sidegan.robot import load_robot
from tests.identification import recordings
from tests.identification.recordings import (
    Fixed,
    assert_close,
    model_of,
    multisine,
    noisy_rows,
    recorded,
    truth_of,
    white,
)

PLAIN = ["ols", "weighted"]  # need no arm, and scale with the torque


@pytest.fixture(scope="module")
def rows():
    return noisy_rows(400)


def fitted(method, rows):
    model = Fixed(rows[0])
    return estimate(method, model, model.measurements(rows[1]))


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
    def test_parameters_are_equivariant_to_shift_and_scale(self, rows, factor, seed, method):
        shift = np.random.default_rng(seed).normal(size=6)
        original = fitted(method, rows)
        other = fitted(method, (rows[0], factor * rows[1] + rows[0] @ shift))
        assert_close(other.parameters, factor * original.parameters + shift, 1e-3)
        assert_close(other.deviation, factor * original.deviation, 1e-2)

    @settings(max_examples=20, deadline=None)
    @given(st.integers(1, 500), st.integers(1, 399), st.sampled_from(PLAIN))
    def test_blocks_and_recordings_do_not_change_the_estimate(self, rows, size, cut, method):
        model = Fixed(rows[0])
        data = model.measurements(rows[1])
        whole = estimate(method, model, data)
        with recordings.at_once(size):
            found = estimate(method, model, iter([data[:cut], data[cut:]]))
        assert_close(found.parameters, whole.parameters, 1e-8)
        assert found.samples == 400


def low_passed(noise):
    """Noise after the zero-phase filter that recordings go through: 5 Hz at 100 Hz."""
    return sosfiltfilt(butter(4, 0.1, output="sos"), noise, axis=0)


class TestStatedDeviations:
    @pytest.mark.parametrize(
        ("name", "method", "samples", "colour", "error"),
        [
            *(("planar2", method, 300, np.copy, 0.12) for method in ("weighted", "ols")),
            ("kuka_lwr4", "weighted", 600, np.copy, 0.05),
            ("planar2", "weighted", 2000, low_passed, 0.12),
        ],
    )
    def test_cover_the_true_parameters(self, name, method, samples, colour, error):
        model, found = model_of(load_robot(name)), []
        y, truth = model.regressor(*multisine(model.joints, samples, seed=4)), truth_of(model)
        fixed, level = Fixed(y), np.linspace(2.0, 0.2, model.joints)
        for k in range(50):
            noise = colour(white((samples, model.joints), k, 7))
            result = estimate(method, fixed, fixed.measurements(y @ truth + level * noise))
            found.append((result.parameters - truth) / result.deviation)
        assert (np.abs(found) <= 3).mean() >= 0.99
        assert np.std(found) == pytest.approx(1.0, abs=error)


class TestCorrelation:
    @pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
    def test_is_that_of_an_autoregressive_process(self, phi):
        random = np.random.default_rng(1)
        r = np.zeros((20_000, 2))
        for t in range(1, len(r)):
            r[t] = phi * r[t - 1] + random.normal(size=2)
        inflation = inflation_of(split(r, 4096))
        assert inflation.tolist() == pytest.approx([(1 + phi) / (1 - phi)] * 2, rel=0.2)

    @settings(max_examples=30, deadline=None)
    @given(st.integers(1, 60), st.integers(0, 99))
    def test_is_at_least_one(self, samples, seed):
        r = np.random.default_rng(seed).normal(size=(samples, 3))
        r[:, 2] = 0  # a residual of nothing correlates with nothing
        inflation = inflation_of([r, r[:1]])
        assert (inflation >= 1).all() and np.isfinite(inflation).all()
