"""Drive gains, payloads and Stribeck velocities: what is identified beside an arm's own parameters."""

import numpy as np
import pytest
import torch

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification import Measurements, drive_gains, estimate, identify_payload, stribeck_velocities
from sidegan.robot import pseudo_inertia
from sidegan.robot.consistency import FROM_PSEUDO_INERTIA
from tests.identification.recordings import model_of, multisine, recorded, truth_of

_POINTS = torch.tensor(  # of 0.75 kg each, in the last joint's frame
    [[0.1, 0.05, 0.1, 1.0], [-0.05, 0.08, 0.05, 1.0], [0.02, -0.1, 0.15, 1.0], [0.06, 0.04, 0.02, 1.0]],
    dtype=torch.float64,
)
LOAD = FROM_PSEUDO_INERTIA @ (0.75 * _POINTS.T @ _POINTS).flatten()
GAINS = torch.tensor([14.0, 13.0, 11.0, 10.0, 9.0, 12.0, 8.0], dtype=torch.float64)


def noise_like(x, seed):
    return torch.from_numpy(np.random.default_rng(seed).normal(size=x.shape))


def loaded(model, samples, seed=3):
    """States, and the torque of the true model with the load."""
    states = multisine(model.joints, samples, seed)
    load = model.body.regressor(*states)[..., -10:] @ LOAD
    return states, model.torque(truth_of(model), *states) + load


class TestPayload:
    @pytest.mark.parametrize("method", ["ols", "weighted", "huber"])
    def test_is_found_to_its_deviation(self, arm, method):
        model = model_of(arm)
        states, torque = loaded(model, 1500)
        data = Measurements(*states, torque + 0.5 * noise_like(torque, 1))
        found = identify_payload(model, truth_of(model), [data], method)
        assert ((found.parameters - LOAD).abs() < 4 * found.deviation).all()
        assert found.mass == pytest.approx(3.0, abs=0.05)
        torch.testing.assert_close(found.centre, _POINTS[:, :3].mean(0), rtol=0, atol=0.01)

    def test_deviations_hold(self, arm):
        model = model_of(arm)
        states, torque = loaded(model, 600)
        ratios = []
        for seed in range(25):
            data = Measurements(*states, torque + 0.5 * noise_like(torque, seed))
            found = identify_payload(model, truth_of(model), data)
            ratios.append((found.parameters - LOAD) / found.deviation)
        assert (torch.stack(ratios).abs() <= 3).double().mean() >= 0.98

    def test_exists_or_not(self, arm):
        model = model_of(arm)
        states, torque = loaded(model, 300)
        found = identify_payload(model, truth_of(model), Measurements(*states, torque))
        assert found.exists and found.possible is found.parameters
        rough = Measurements(*states, torque + 5.0 * noise_like(torque, 2))
        found = identify_payload(model, truth_of(model), rough)
        assert not found.exists
        assert torch.linalg.eigvalsh(pseudo_inertia(found.possible))[0] > 0
        assert ((found.possible - found.parameters).abs() < 3 * found.deviation).all()

    def test_a_stream_is_read_once(self, arm):
        model = model_of(arm)
        states, torque = loaded(model, 300)
        data = Measurements(*states, torque)
        found = identify_payload(model, truth_of(model), iter([data[:100], data[100:]]))
        torch.testing.assert_close(found.parameters, LOAD, rtol=1e-4, atol=1e-5)
        with pytest.raises(ConfigError, match="huber reads"):
            identify_payload(model, truth_of(model), iter([data]), "huber")

    def test_bad_input(self, planar):
        model = model_of(planar)
        with pytest.raises(ConfigError, match="consistent pulls towards an arm's description"):
            identify_payload(model, truth_of(model), recorded(model, 50), "consistent")
        with pytest.raises(ShapeError, match="the model has"):
            identify_payload(model, torch.zeros(3), recorded(model, 50))


class TestDriveGains:
    def recordings(self, model, samples, level, seed):
        gains = GAINS[: model.joints]
        plain = recorded(model, samples, seed=10)
        states, torque = loaded(model, samples)
        runs = [(plain.states, plain.torque), (states, torque)]
        return [
            Measurements(*x, tau / gains + level * noise_like(tau, [seed, k]))
            for k, (x, tau) in enumerate(runs)
        ]

    def test_without_noise_they_are_exact(self, arm):
        model = model_of(arm)
        found = drive_gains(model, *self.recordings(model, 800, 0.0, 0), LOAD)
        torch.testing.assert_close(found.gains, GAINS, rtol=1e-4, atol=0)
        torch.testing.assert_close(found.parameters, truth_of(model), rtol=1e-2, atol=1e-2)

    def test_deviations_hold_and_noise_makes_no_bias(self, arm):
        model = model_of(arm)
        ratios = []
        for seed in range(30):
            found = drive_gains(model, *self.recordings(model, 600, 0.2, seed), LOAD)
            ratios.append((found.gains - GAINS) / found.deviation)
        z = torch.stack(ratios)
        assert (z.abs() <= 3).double().mean() >= 0.98
        assert (z.mean(0).abs() < 3.5 / 30**0.5).all()

    def test_bad_input(self, planar):
        model = model_of(planar)
        data = recorded(model, 100)
        with pytest.raises(ShapeError, match="expected ten finite parameters"):
            drive_gains(model, data, data, LOAD[:9])
        with pytest.raises(ConfigError, match="no effect on shoulder, elbow: their gains"):
            drive_gains(model, data, data, 0 * LOAD)
        with pytest.raises(ShapeError, match="no samples"):
            drive_gains(model, [], data, LOAD)


class TestStribeck:
    def test_velocities_are_found(self, planar):
        truth = model_of(planar, (0.05, 0.2))
        states = multisine(2, 3000)
        terms = {n: torch.tensor([2.0, 1.0]) for n in ("viscous", "coulomb", "stribeck")}
        torque = truth.torque(truth.base_of(planar.inertial_parameters, terms), *states)
        data = Measurements(*states, torque + 0.05 * noise_like(torque, 0))
        found = stribeck_velocities(model_of(planar), iter([data]), (0.02, 0.05, 0.1, 0.2, 0.4))
        assert found == [0.05, 0.2]
        better = estimate("weighted", model_of(planar, found), data)
        assert (better.residual_rms < estimate("weighted", model_of(planar), data).residual_rms).all()

    @pytest.mark.parametrize("candidates", [(), (0.1, 0.0)])
    def test_bad_candidates(self, planar, candidates):
        with pytest.raises(ConfigError, match="expected some above zero"):
            stribeck_velocities(model_of(planar), recorded(model_of(planar), 50), candidates)
