import math

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification import Rls


def classical(y, tau, prior, forgetting):
    """Covariance recursion, a sample of all joints at a time (Ljung 1999, eq. 11.29)."""
    p = np.eye(y.shape[2]) * prior
    estimate = np.zeros(y.shape[2])
    for rows, torque in zip(y.numpy(), tau.numpy()):
        gain = p @ rows.T @ np.linalg.inv(forgetting * np.eye(len(rows)) + rows @ p @ rows.T)
        estimate = estimate + gain @ (torque - rows @ estimate)
        p = (p - gain @ rows @ p) / forgetting
        p = (p + p.T) / 2
    return estimate, p


def batch(y, tau, prior, weights=(1.0, 1.0, 1.0), forgetting=1.0):
    """Least squares of all rows, weighted by joint and age, and of the prior's rows."""
    count, _, parameters = y.shape
    decay = np.sqrt(forgetting ** np.arange(count - 1, -1, -1))
    scale = (decay[:, None] * np.asarray(weights)).reshape(-1)
    rest = np.sqrt(forgetting**count / prior) * np.eye(parameters)
    rows = np.vstack([scale[:, None] * y.numpy().reshape(-1, parameters), rest])
    right = np.concatenate([scale * tau.numpy().reshape(-1), np.zeros(parameters)])
    estimate = np.linalg.lstsq(rows, right, rcond=None)[0]
    return estimate, np.linalg.inv(rows.T @ rows)


def fed(y, tau, sizes=None, **settings):
    rls = Rls(y.shape[2], y.shape[1], **settings)
    for rows, torque in zip(y.split(sizes or len(y)), tau.split(sizes or len(tau))):
        rls.update(rows, torque)
    return rls


def assert_close(one, other, tolerance=1e-9):
    """Relative to the largest entry, as a norm."""
    other = np.asarray(other)
    assert np.abs(np.asarray(one) - other).max() <= tolerance * np.abs(other).max()


class TestOracles:
    @pytest.mark.parametrize("prior", [1e-2, 1.0, 1e6, 1e12])
    @pytest.mark.parametrize("weights", [(1.0, 1.0, 1.0), (0.1, 3.0, 40.0)])
    def test_batch_least_squares(self, random_rows, prior, weights):
        found = fed(*random_rows, prior=prior).solve(torch.tensor(weights))
        estimate, covariance = batch(*random_rows, prior, weights)
        assert_close(found.parameters, estimate)
        assert_close(found.covariance, covariance)

    @pytest.mark.parametrize("forgetting", [0.9, 0.99, 1.0])
    @pytest.mark.parametrize("prior", [0.5, 1e3])
    def test_the_classical_recursion(self, random_rows, forgetting, prior):
        found = fed(*random_rows, sizes=37, prior=prior, forgetting=forgetting)
        estimate, covariance = classical(*random_rows, prior, forgetting)
        assert_close(found.estimate, estimate)
        assert_close(found.covariance, covariance)

    @pytest.mark.parametrize("forgetting", [0.8, 0.99])
    def test_weighted_batch_least_squares_with_forgetting(self, random_rows, forgetting):
        found = fed(*random_rows, forgetting=forgetting).solve(torch.tensor([1.0, 2.0, 3.0]))
        estimate, covariance = batch(*random_rows, 1e6, (1, 2, 3), forgetting)
        assert_close(found.parameters, estimate)
        assert_close(found.covariance, covariance)

    def test_one_parameter_by_hand(self):
        # A = 1 + 4 + 1/2 and b = 3 + 2 · 8: π = 19 / 5.5.
        rls = Rls(1, 1, prior=2.0)
        rls.update(torch.tensor([[[1.0]], [[2.0]]]), torch.tensor([[3.0], [8.0]]))
        assert rls.estimate.tolist() == pytest.approx([19 / 5.5], rel=1e-14)
        assert rls.covariance.tolist() == [pytest.approx([1 / 5.5], rel=1e-14)]

    def test_forgetting_by_hand(self):
        # A = 0.5 · 1 + 4 + 0.25 / 2 and b = 0.5 · 3 + 16.
        rls = Rls(1, 1, prior=2.0, forgetting=0.5)
        rls.update(torch.tensor([[[1.0]], [[2.0]]]), torch.tensor([[3.0], [8.0]]))
        assert rls.estimate.tolist() == pytest.approx([17.5 / 4.625], rel=1e-14)

    def test_residual_and_variance_are_those_of_the_residuals(self, random_rows):
        y, tau = random_rows
        weights = torch.tensor([1.0, 2.0, 30.0], dtype=torch.float64)
        found = fed(y, tau, sizes=64).solve(weights)
        residual = tau - y @ found.parameters
        torch.testing.assert_close(found.residual, residual.square().mean(0).sqrt(), rtol=1e-9, atol=0)
        assert found.variance == pytest.approx(
            float((weights * residual).square().sum() / (600 - 6)), rel=1e-9
        )
        torch.testing.assert_close(found.error_covariance, found.variance * found.covariance)
        assert found.samples == 200 and found.weights.tolist() == [1, 2, 30]


class TestLaws:
    @given(st.lists(st.integers(1, 60), min_size=1, max_size=20), st.sampled_from([0.9, 1.0]))
    def test_the_size_of_the_chunks_does_not_matter(self, sizes, forgetting):
        random = np.random.default_rng(0)
        count = sum(sizes)
        y, tau = (torch.from_numpy(random.normal(size=s)) for s in ((count, 2, 4), (count, 2)))
        one, other = (fed(y, tau, sizes=s, forgetting=forgetting) for s in (sizes, count))
        assert one.samples == other.samples
        assert_close(one.estimate, other.estimate, 1e-10)
        assert_close(one.covariance, other.covariance, 1e-10)

    def test_the_order_of_the_chunks_does_not_matter_without_forgetting(self, random_rows):
        y, tau = random_rows
        one, other = fed(y, tau, sizes=50), fed(y.flip(0), tau.flip(0), sizes=30)
        assert_close(one.estimate, other.estimate, 1e-12)

    def test_with_forgetting_the_latest_model_wins(self, random_rows):
        y, _ = random_rows
        before, after = torch.ones(6, dtype=torch.float64), torch.arange(6, dtype=torch.float64)
        tau = torch.cat([y[:100] @ before, y[100:] @ after])
        assert_close(fed(y, tau, forgetting=0.7).estimate, after, 1e-6)
        assert (fed(y, tau).estimate - after).abs().max() > 0.1

    def test_exact_data_give_the_exact_parameters(self, random_rows):
        y, _ = random_rows
        true = torch.tensor([4.0, -0.3, 0.05, 1.2, -0.02, 0.4], dtype=torch.float64)
        assert_close(fed(y, y @ true, prior=1e12).estimate, true, 1e-8)

    def test_before_any_sample_there_is_the_prior(self):
        rls = Rls(4, 2, prior=3.0)
        rls.update(torch.zeros(0, 2, 4), torch.zeros(0, 2))
        found = rls.solve()
        assert found.parameters.tolist() == [0] * 4 and found.samples == 0
        torch.testing.assert_close(found.covariance, 3.0 * torch.eye(4, dtype=torch.float64))
        assert found.variance == math.inf

    def test_more_samples_make_it_surer(self, random_rows):
        y, tau = random_rows
        traces = [float(fed(y[:n], tau[:n]).covariance.trace()) for n in (2, 10, 100, 200)]
        assert traces == sorted(traces, reverse=True)

    def test_a_common_weight_scales_the_covariance_alone(self, random_rows):
        rls = fed(*random_rows, prior=1e14)
        one, other = rls.solve(), rls.solve(torch.full((3,), 10.0))
        assert_close(other.parameters, one.parameters)
        assert_close(other.covariance * 100, one.covariance)
        assert_close(other.error_covariance, one.error_covariance)

    def test_single_precision_is_summed_in_double(self, random_rows):
        y, tau = (x.float() for x in random_rows)
        assert_close(fed(y, tau).estimate, fed(y.double(), tau.double()).estimate, 1e-14)

    def test_gradients_are_not_collected(self, random_rows):
        y, tau = random_rows
        assert not fed(y.clone().requires_grad_(), tau).estimate.requires_grad


class TestPoorData:
    @pytest.mark.parametrize("prior", [1e-2, 1e6, 1e14])
    @pytest.mark.parametrize("sizes", [1, 7, 200])
    def test_directions_without_data_stay_at_the_prior(self, random_rows, prior, sizes):
        y, tau = (x.clone() for x in random_rows)
        y[..., 2] = 0  # no effect at all
        y[..., 5] = 0.3 * y[..., 1]  # only the sum of two shows
        found = fed(y, tau, sizes=sizes, prior=prior).solve()
        blind = torch.tensor([[0, 0, 1, 0, 0, 0], [0, -0.3, 0, 0, 0, 1]], dtype=torch.float64)
        blind = blind / blind.norm(dim=1, keepdim=True)
        assert_close(blind @ found.parameters + 1, [1, 1], 1e-9)
        assert_close((blind @ found.covariance @ blind.T).diagonal(), [prior, prior], 1e-6)
        kept = y[..., [0, 1, 3, 4]]
        seen = np.linalg.lstsq(kept.reshape(-1, 4).numpy(), tau.reshape(-1).numpy(), rcond=None)[0]
        if prior > 1:
            np.testing.assert_allclose(y @ found.parameters, kept @ torch.from_numpy(seen), rtol=0, atol=1e-4)

    def test_fewer_equations_than_parameters(self, random_rows):
        y, tau = (x[:1] for x in random_rows)
        found = fed(y, tau, prior=1e8).solve()
        assert_close((y @ found.parameters)[0], tau[0], 1e-3)
        assert_close(found.parameters, batch(y, tau, 1e8)[0], 1e-6)
        assert found.variance == math.inf

    @pytest.mark.parametrize("decades", [2, 4, 6])
    def test_ill_conditioned_data(self, decades):
        random = np.random.default_rng(1)
        u = np.linalg.qr(random.normal(size=(900, 8)))[0]
        v = np.linalg.qr(random.normal(size=(8, 8)))[0]
        y = torch.from_numpy((u * np.logspace(0, -decades, 8) @ v).reshape(300, 3, 8))
        true = torch.from_numpy(random.normal(size=8))
        found = fed(y, y @ true, prior=1e18, sizes=64)
        # cond(YᵀY) = 10^(2 · decades) times rounding is what the information form can lose.
        assert_close(found.estimate, true, 1e-15 * 100**decades * 10)
        assert_close(y @ found.estimate, y @ true, 1e-9)

    def test_units_that_differ_by_ten_decades_are_no_lack_of_excitation(self, random_rows):
        y, tau = random_rows
        unit = torch.tensor([1e-5, 1, 1, 1e5, 1, 1], dtype=torch.float64)
        one, other = fed(y, tau, prior=1e18), fed(y * unit, tau, prior=1e18)
        assert_close(other.estimate * unit, one.estimate, 1e-7)

    def test_the_covariance_is_symmetric_and_positive(self, random_rows):
        y, tau = random_rows
        y = torch.cat([y, y @ torch.ones(6, 1, dtype=torch.float64)], 2)
        covariance = fed(y, tau, prior=1e4).covariance
        torch.testing.assert_close(covariance, covariance.T)
        assert torch.linalg.eigvalsh(covariance).min() > 0

    def test_a_long_forgotten_prior_stays_finite(self, random_rows):
        y, tau = (x.clone() for x in random_rows)
        y[..., 2] = 0
        rls = Rls(6, 3, forgetting=0.5)
        for _ in range(20):
            rls.update(y, tau)
        found = rls.solve()
        assert found.parameters.isfinite().all() and found.covariance.isfinite().all()
        assert abs(found.parameters[2]) < 1e-12 and found.covariance[2, 2] > 1e100


class TestWeighted:
    def test_the_weights_are_those_of_the_residuals(self, random_rows):
        y, tau = random_rows
        found = fed(y, tau).solve_weighted()
        residual = (tau - y @ found.parameters).square().mean(0).sqrt()
        torch.testing.assert_close(found.weights, 1 / residual, rtol=2e-3, atol=0)
        assert_close(found.parameters, batch(y, tau, 1e6, found.weights.numpy())[0])
        # Weighted residuals have unit variance, less the degrees of freedom spent.
        assert found.variance == pytest.approx(1, abs=0.02)

    def test_a_small_joint_is_not_drowned(self):
        random = np.random.default_rng(2)
        y = torch.from_numpy(random.normal(size=(500, 2, 4)))
        true = torch.from_numpy(random.normal(size=4))
        tau = y @ true + torch.from_numpy(random.normal(size=(500, 2)) * [10, 1e-3])
        rls = fed(y, tau)
        plain, weighted = rls.solve(), rls.solve_weighted()
        assert (weighted.parameters - true).norm() < 1e-3 * (plain.parameters - true).norm()
        assert weighted.residual.tolist() == pytest.approx([10, 1e-3], rel=0.1)

    def test_its_error_covariance_is_that_of_the_errors(self):
        random = np.random.default_rng(4)
        y = torch.from_numpy(random.normal(size=(200, 2, 3)))
        true = torch.ones(3, dtype=torch.float64)
        distances = []
        for _ in range(200):
            tau = y @ true + torch.from_numpy(random.normal(size=(200, 2)) * [5, 0.1])
            found = fed(y, tau).solve_weighted()
            error = found.parameters - true
            distances.append(float(error @ torch.linalg.solve(found.error_covariance, error)))
        # Mahalanobis distances are χ² with 3 degrees of freedom: mean 3, standard error √(6 / 200).
        assert np.mean(distances) == pytest.approx(3, abs=5 * math.sqrt(6 / 200))

    def test_exact_data_do_not_divide_by_zero(self, random_rows):
        y, _ = random_rows
        true = torch.arange(1.0, 7.0, dtype=torch.float64)
        found = fed(y, y @ true, prior=1e12).solve_weighted()
        assert found.weights.isfinite().all()
        assert_close(found.parameters, true, 1e-8)

    def test_a_joint_without_torque_does_not_divide_by_zero(self, random_rows):
        y, tau = (x.clone() for x in random_rows)
        y[:, 1], tau[:, 1] = 0, 0
        found = fed(y, tau).solve_weighted()
        assert found.weights.isfinite().all() and found.parameters.isfinite().all()

    @pytest.mark.parametrize("samples", [0, 10])
    def test_no_torque_at_all_is_refused(self, samples):
        rls = Rls(4, 2)
        rls.update(torch.ones(samples, 2, 4), torch.zeros(samples, 2))
        with pytest.raises(ShapeError, match="zero"):
            rls.solve_weighted()


class TestDoor:
    @pytest.mark.parametrize("prior", [0.0, -1.0, math.inf, math.nan])
    def test_prior(self, prior):
        with pytest.raises(ConfigError, match=str(prior)):
            Rls(3, 2, prior=prior)

    @pytest.mark.parametrize("forgetting", [0.0, 1.01, -0.5, math.nan])
    def test_forgetting(self, forgetting):
        with pytest.raises(ConfigError, match=str(forgetting)):
            Rls(3, 2, forgetting=forgetting)

    @pytest.mark.parametrize(
        ("y", "tau"),
        [
            ((5, 2, 4), (5, 2)),
            ((5, 3, 3), (5, 2)),
            ((5, 2, 3), (5, 1)),
            ((4, 2, 3), (5, 2)),
            ((10, 3), (10,)),
        ],
    )
    def test_shapes(self, y, tau):
        with pytest.raises(ShapeError, match=r"expected \(S, 2, 3\)"):
            Rls(3, 2).update(torch.ones(y), torch.ones(tau))

    @pytest.mark.parametrize("value", [math.nan, math.inf, 1e200])
    def test_values_and_the_chunk_is_left_out(self, random_rows, value):
        y, tau = random_rows
        rls = fed(y, tau)
        before = rls.estimate
        for bad in (y.clone(), tau.clone()):
            bad[5, 1] = value
            with pytest.raises(ShapeError, match="finite"):
                rls.update(*((bad, tau) if bad.ndim == 3 else (y, bad)))
        assert torch.equal(rls.estimate, before) and rls.samples == 200

    @pytest.mark.parametrize("weights", [[1.0, 1.0], [1.0, 0.0, 1.0], [1.0, -1.0, 1.0], [1.0, math.nan, 1.0]])
    def test_weights(self, random_rows, weights):
        with pytest.raises(ShapeError, match="3 positive numbers"):
            fed(*random_rows).solve(torch.tensor(weights))
