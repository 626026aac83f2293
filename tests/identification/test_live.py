import numpy as np
import pytest
import torch

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification import Live, estimate
from sidegan.identification.gather import gather
from tests.identification.recordings import model_of, recorded


def samples_of(data):
    return zip(*(x.numpy() for x in (*data.states, data.torque)))


def fed(model, data, **settings):
    live = Live(model, **settings)
    for sample in samples_of(data):
        live.update(*sample)
    return live


class TestOracle:
    @pytest.mark.parametrize("forgetting", [0.99, 1.0])
    def test_batch_least_squares(self, arm, forgetting):
        model = model_of(arm)
        data = recorded(model, 400, noise=0.5)
        live = fed(model, data, forgetting=forgetting)
        batch = estimate("rls", model, data, forgetting=forgetting)
        np.testing.assert_allclose(live.parameters, batch.parameters, rtol=1e-6, atol=1e-8)
        assert live.samples == 400

    def test_the_weights_of_the_start_and_the_covariance(self, planar):
        model = model_of(planar)
        data = recorded(model, 300, noise=torch.tensor([2.0, 0.1]))
        first = estimate("weighted", model, data[:200])
        more, moment = gather(model, data[200:]).sums.weighted(first.weights)
        expected = torch.linalg.inv(first.information + more + 1e-6 * torch.eye(model.count))
        live = fed(model, data[200:], start=first)
        np.testing.assert_allclose(live.covariance, expected.numpy(), rtol=1e-4)
        known = first.information + 1e-6 * torch.eye(model.count)
        parameters = expected @ (known @ first.parameters + moment)
        np.testing.assert_allclose(live.parameters, parameters.numpy(), rtol=1e-5, atol=1e-7)

    def test_goes_on_from_an_earlier_estimate(self, planar):
        model = model_of(planar)
        data = recorded(model, 400, noise=0.5)
        first = estimate("ols", model, data[:250])
        live = fed(model, data[250:], start=first)
        whole = estimate("ols", model, data)
        np.testing.assert_allclose(live.parameters, whole.parameters, rtol=1e-6, atol=1e-8)

    def test_follows_a_change_and_says_so(self, planar):
        model = model_of(planar)
        data = recorded(model, 600)
        live = fed(model, data, forgetting=0.97)
        sample = next(samples_of(data))
        assert np.abs(live.residual(*sample)).max() < 1e-4
        heavier = [(q, dq, ddq, 2 * tau) for q, dq, ddq, tau in samples_of(data)]
        assert np.abs(live.residual(*heavier[0])).max() > 1
        for one in heavier:
            live.update(*one)
        assert np.abs(live.residual(*heavier[0])).max() < 1e-2

    def test_forgets_everything_and_stays_finite(self, planar):
        model = model_of(planar)
        live = Live(model, forgetting=0.5)
        for _ in range(3000):
            live.update(*np.zeros((4, 2)))
        assert np.isfinite(live.parameters).all()


class TestBadInput:
    def test_settings(self, planar):
        model = model_of(planar)
        with pytest.raises(ConfigError, match="forgetting is 0"):
            Live(model, forgetting=0.0)
        with pytest.raises(ConfigError, match="prior is -1"):
            Live(model, prior=-1.0)

    def test_a_start_of_another_model(self, planar):
        other = model_of(planar, offset=False)
        with pytest.raises(ConfigError, match="other parameters"):
            Live(model_of(planar), start=estimate("ols", other, recorded(other, 100)))

    def test_samples(self, planar):
        live = Live(model_of(planar))
        good = np.zeros(2)
        with pytest.raises(ShapeError, match=r"shape \(3,\), expected \(2,\)"):
            live.update(good, good, good, np.zeros(3))
        with pytest.raises(ShapeError, match="not finite"):
            live.update(good, good, np.array([0.0, np.nan]), good)
        assert live.samples == 0
