"""Estimates and their own errors, against laws, least squares of the rows and the classical recursion."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from sidegan.base.arrays import split
from sidegan.identification.estimate import ESTIMATORS, estimate
from sidegan.identification.fit import gather, inflation_of, least_squares, weighted_least_squares
from sidegan.robot import load_robot
from tests.identification import recordings
from tests.identification.recordings import (
    Fixed,
    assert_close,
    at_once,
    model_of,
    multisine,
    noisy_rows,
    recorded,
    truth_of,
    white,
)

PLAIN = ["ols", "weighted"]  # need no arm, and scale with the torque


ROWS = noisy_rows(400)


def fitted(method, y, tau):
    model = Fixed(y)
    return estimate(method, model, model.measurements(tau))


def test_condition_is_that_of_scaled_columns():
    found = fitted("weighted", *ROWS)
    y = (ROWS[0] * found.weights[:, None]).reshape(-1, 6)
    assert found.condition == pytest.approx(np.linalg.cond(y / np.linalg.norm(y, axis=0)), rel=1e-6)


class TestLaws:
    @pytest.mark.parametrize("method", ESTIMATORS)
    def test_exact_torques_give_the_true_parameters(self, planar, method):
        model = model_of(planar)
        found = estimate(method, model, recorded(model, 600))
        tolerance = 2e-3 if method == "consistent" else 1e-4
        scale = np.maximum(np.abs(truth_of(model)), 0.1)
        assert (np.abs(found.parameters - truth_of(model)) / scale).max() < tolerance

    @settings(max_examples=25)
    @given(st.sampled_from([0.02, 0.5, 7.0, 100.0]), st.integers(0, 1000), st.sampled_from(PLAIN))
    def test_parameters_are_equivariant_to_shift_and_scale(self, factor, seed, method):
        (y, tau), shift = ROWS, np.random.default_rng(seed).normal(size=6)
        original, other = fitted(method, y, tau), fitted(method, y, factor * tau + y @ shift)
        assert_close(other.parameters, factor * original.parameters + shift, 1e-3)
        assert_close(other.deviation, factor * original.deviation, 1e-2)

    @settings(max_examples=20)
    @given(st.integers(1, 500), st.integers(1, 399), st.sampled_from(PLAIN))
    def test_blocks_and_recordings_do_not_change_the_estimate(self, size, cut, method):
        model = Fixed(ROWS[0])
        data = model.measurements(ROWS[1])
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


def test_exact_torques_are_as_certain_as_sums_resolve_them():
    """To a millionth: what is left of their squares is rounding, or nothing at all."""
    y, _ = ROWS
    found = fitted("ols", y, y @ np.ones(6))
    usual = np.sqrt(np.square(y @ np.ones(6)).mean(0))
    np.testing.assert_allclose(found.certainty * np.sqrt(found.inflation), 1e6 / usual, rtol=1e-9)


class TestCorrelation:
    @pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
    def test_is_that_of_an_autoregressive_process(self, phi):
        random = np.random.default_rng(1)
        r = np.zeros((20_000, 2))
        for t in range(1, len(r)):
            r[t] = phi * r[t - 1] + random.normal(size=2)
        inflation = inflation_of(split(r, 4096))
        assert inflation.tolist() == pytest.approx([(1 + phi) / (1 - phi)] * 2, rel=0.2)

    @settings(max_examples=30)
    @given(st.integers(1, 60), st.integers(0, 99))
    def test_is_at_least_one(self, samples, seed):
        r = np.random.default_rng(seed).normal(size=(samples, 3))
        r[:, 2] = 0  # a residual of nothing correlates with nothing
        inflation = inflation_of([r, r[:1]])
        assert (inflation >= 1).all() and np.isfinite(inflation).all()


def classical(y, tau, prior):
    """Covariance recursion, a sample of all joints at a time (Ljung 1999, eq. 11.29)."""
    p = np.eye(y.shape[2]) * prior
    estimate = np.zeros(y.shape[2])
    for rows, torque in zip(y, tau):
        gain = p @ rows.T @ np.linalg.inv(np.eye(len(rows)) + rows @ p @ rows.T)
        estimate = estimate + gain @ (torque - rows @ estimate)
        p = p - gain @ rows @ p
        p = (p + p.T) / 2
    return estimate, p


def batch(y, tau, prior, weights):
    """Least squares of all rows, weighted by joint, and of the prior's rows."""
    count, _, parameters = y.shape
    scale = np.tile(weights, count)
    rows = np.vstack([scale[:, None] * y.reshape(-1, parameters), np.eye(parameters) / np.sqrt(prior)])
    right = np.concatenate([scale * tau.reshape(-1), np.zeros(parameters)])
    return np.linalg.lstsq(rows, right, rcond=None)[0], np.linalg.inv(rows.T @ rows)


def fed(y, tau, size=None, prior=1e6, fit=least_squares):
    model = Fixed(y)
    with at_once(size or len(y)):
        return fit(gather(model, model.measurements(tau)).sums, 1 / prior)


class TestOracles:
    @pytest.mark.parametrize("prior", [0.5, 1e3])
    def test_the_classical_recursion(self, prior):
        fit = fed(*ROWS, 37, prior)
        parameters, covariance = classical(*ROWS, prior)
        # the recursion begins at P₀, of which it subtracts nearly all: it rounds by this share
        rounding = np.finfo(float).eps * prior / np.linalg.eigvalsh(covariance).min()
        assert_close(fit.parameters, parameters, rounding)
        assert_close(fit.inverse, covariance, rounding)

    def test_weights_are_the_inverse_residual_deviations(self):
        fit = fed(*ROWS, fit=weighted_least_squares)
        parameters, inverse = batch(*ROWS, 1e6, fit.weights)
        assert_close(fit.parameters, parameters)
        assert_close(fit.inverse, inverse)
        residual = ROWS[1] - ROWS[0] @ fit.parameters
        assert_close(fit.weights, 1 / np.sqrt(np.square(residual).mean(0)), 2e-3)


class TestPoorData:
    @pytest.mark.parametrize("prior", [1e-2, 1e6, 1e14])
    def test_directions_without_data_stay_at_the_prior(self, prior):
        y, tau = (x.copy() for x in ROWS)
        y[..., 2] = 0  # no effect at all
        y[..., 5] = 0.3 * y[..., 1]  # only the sum of two shows
        fit = fed(y, tau, 7, prior)
        blind = np.array([[0, 0, 1, 0, 0, 0], [0, -0.3, 0, 0, 0, 1]])
        blind = blind / np.linalg.norm(blind, axis=1, keepdims=True)
        if prior < 1e10:  # beyond that a direction's rounding exceeds the others' variance
            assert_close(fit.inverse, fit.inverse.T)
            assert np.linalg.eigvalsh(fit.inverse).min() > 0
        assert_close(blind @ fit.parameters + 1, [1, 1], 1e-9)
        assert_close((blind @ fit.inverse @ blind.T).diagonal(), [prior, prior], 1e-6)
        kept = y[..., [0, 1, 3, 4]]
        seen = np.linalg.lstsq(kept.reshape(-1, 4), tau.reshape(-1), rcond=None)[0]
        if prior > 1:
            np.testing.assert_allclose(y @ fit.parameters, kept @ seen, rtol=0, atol=1e-4)

    @pytest.mark.parametrize("decades", [2, 4, 6])
    def test_ill_conditioned_data_are_fitted_to_rounding(self, decades):
        random = np.random.default_rng(1)
        u = np.linalg.qr(random.normal(size=(900, 8)))[0]
        v = np.linalg.qr(random.normal(size=(8, 8)))[0]
        y = (u * np.logspace(0, -decades, 8) @ v).reshape(300, 3, 8)
        true = random.normal(size=8)
        parameters = fed(y, y @ true, 64, prior=1e18).parameters
        # cond(YᵀY) = 10^(2 · decades) times rounding is what the information form can lose.
        assert_close(parameters, true, 1e-15 * 100**decades * 10)
        assert_close(y @ parameters, y @ true, 1e-9)

    def test_units_ten_decades_apart_do_not_matter(self):
        y, tau = ROWS
        unit = np.array([1e-5, 1, 1, 1e5, 1, 1])
        plain, scaled = fed(y, tau, prior=1e18), fed(y * unit, tau, prior=1e18)
        assert_close(scaled.parameters * unit, plain.parameters, 1e-7)
