"""Least squares on sums, against least squares of the rows and the classical recursion."""

import numpy as np
import pytest

from sidegan.identification.fit import gather, least_squares, reweighted
from tests.identification.recordings import Fixed, assert_close, at_once, noisy_rows

ROWS = noisy_rows(200)


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
        assert_close(fit.parameters, parameters)
        assert_close(fit.inverse, covariance)

    def test_weights_are_the_inverse_residual_deviations(self):
        fit = fed(*ROWS, fit=reweighted)
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
