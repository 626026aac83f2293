import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification import (
    Measurements,
    estimate,
    folds,
    score,
    trust,
)
from sidegan.identification.score import score_of_sums
from sidegan.identification.trust import certainty, grams_of, most_informative
from sidegan.motion.trajectory import Trajectory
from tests.identification.recordings import model_of, multisine, recorded, truth_of

NOISE = 0.3


@pytest.fixture(scope="module")
def good(planar):
    """A model, its estimate from a good recording, and another recording."""
    model = model_of(planar)
    data = recorded(model, 2000, NOISE)
    return model, estimate("weighted", model, data), recorded(model, 1000, NOISE, seed=1)


@pytest.fixture(scope="module")
def half_still(planar):
    """A model and its estimate from a recording in which the second joint hardly moves."""
    model = model_of(planar)
    states = [x * torch.tensor([1.0, 1e-3]) for x in multisine(2, 1000)]
    torque = model.torque(truth_of(model), *states)
    noise = torch.from_numpy(np.random.default_rng(0).normal(size=torque.shape))
    data = Measurements(*states, torque + NOISE * noise)
    return model, estimate("weighted", model, data), data


class TestScore:
    def test_is_the_plain_formula(self, good):
        model, found, data = good
        predicted = model.torque(found.parameters, *data.states)
        result = score(model, found.parameters, [data[:300], data[300:]])
        variance = data.torque.var(0, correction=0)
        expected = (data.torque - predicted).square().mean(0) / variance
        torch.testing.assert_close(result.nmse, expected)
        torch.testing.assert_close(result.rmse, (data.torque - predicted).square().mean(0).sqrt())

    @settings(max_examples=20, deadline=None)
    @given(cut=st.integers(1, 999), offset=st.floats(-1e3, 1e3))
    def test_neither_pieces_nor_offsets_matter(self, good, cut, offset):
        model, found, data = good
        moved = replace(data, torque=data.torque + offset)
        parameters = found.parameters.clone()
        parameters[-2:] += offset
        whole = score(model, found.parameters, data)
        result = score(model, parameters, iter([moved[:cut], moved[cut:]]))
        torch.testing.assert_close(result.nmse, whole.nmse, rtol=1e-6, atol=0)

    def test_of_sums_is_the_same(self, good):
        model, found, _ = good
        data = recorded(model, 2000, NOISE)
        expected, result = score(model, found.parameters, data), score_of_sums(found.sums, found.parameters)
        torch.testing.assert_close(result.nmse, expected.nmse)
        torch.testing.assert_close(result.rmse, expected.rmse)

    def test_bad_input(self, good):
        model, found, data = good
        with pytest.raises(ShapeError, match="no samples to test with"):
            score(model, found.parameters, [])
        with pytest.raises(ShapeError, match=r"parameters are \(3,\)"):
            score(model, torch.zeros(3), data)
        constant = replace(data, torque=torch.stack([data.torque[:, 0], torch.ones(1000)], 1))
        with pytest.raises(ShapeError, match=r"torque of joints \[2\] is constant"):
            score(model, found.parameters, constant)

    def test_folds_leave_one_out(self, good):
        model, _, _ = good
        recordings = [recorded(model, 300, NOISE, seed) for seed in range(3)]
        found = folds("weighted", model, recordings)
        for k in range(3):
            others = [x for i, x in enumerate(recordings) if i != k]
            parameters = estimate("weighted", model, others).parameters
            torch.testing.assert_close(found.nmse[k], score(model, parameters, recordings[k]).nmse)
        with pytest.raises(ConfigError, match="at least two recordings, got 1"):
            folds("weighted", model, recordings[:1])


class TestVerdict:
    def test_good(self, good):
        model, found, validation = good
        halves = [validation[:500], validation[500:]]
        result = trust(model, found, [validation], folds("weighted", model, halves))
        assert result.verdict == "good" and not result.weak
        assert result.reasons[0].startswith("mean nMSE 0.00")
        assert result.validation.nmse_mean < result.nominal_score.nmse_mean < 0.02
        assert (result.torque_deviation < 0.1).all()

    def test_without_validation_it_is_usable_at_best(self, good):
        model, found, _ = good
        result = trust(model, found)
        assert result.verdict == "usable"
        assert result.reasons == [
            "no recording was held out: how well the model predicts others is not known"
        ]

    def test_cross_validation_is_held_out_too(self, good):
        model, found, validation = good
        result = trust(model, found, None, folds("weighted", model, [validation[:500], validation[500:]]))
        assert result.verdict == "good" and "on each recording by the others" in result.reasons[0]

    def test_a_joint_that_hardly_moved_is_named_with_advice(self, half_still):
        model, found, data = half_still
        result = trust(model, found, [data])
        assert result.verdict == "not trustworthy"
        said = [r for r in result.reasons if r.startswith("joint 2 (elbow)") and "not identifiable" in r]
        assert len(said) == 1
        assert "excite it with a motion that goes further than" in said[0] and "is faster than" in said[0]
        assert "fv2" in result.weak and "fv1" not in result.weak
        assert not any("joint 1" in r and "not identifiable" in r for r in result.reasons)

    def test_parameters_without_any_effect(self, good):
        model, _, _ = good
        data = recorded(model, 500, NOISE)
        still = replace(
            data, velocity=torch.zeros_like(data.velocity), acceleration=torch.zeros_like(data.velocity)
        )
        result = trust(model, estimate("ols", model, still))
        assert result.verdict == "not trustworthy" and math.isinf(result.estimate.condition)
        assert any("some parameters have no effect" in r for r in result.reasons)
        assert any("more than 1000%" in r for r in result.reasons)

    def test_a_constant_torque(self, good):
        model, _, data = good
        dead = replace(data, torque=torch.stack([data.torque[:, 0], torch.zeros(len(data))], 1))
        result = trust(model, estimate("ols", model, dead))
        assert result.verdict == "not trustworthy"
        said = "joint 2 (elbow): the torque is constant on training data"
        assert [reason.startswith(said) for reason in result.reasons].count(True) == 1

    def test_another_arm_on_the_test_bench(self, good):
        model, found, validation = good
        strange = replace(validation, torque=-validation.torque)
        result = trust(model, found, [strange])
        assert result.verdict == "not trustworthy"
        assert any("times that of training" in r for r in result.reasons)
        assert any("the model leaves" in r and "validation data" in r for r in result.reasons)

    def test_the_description_may_do_as_well(self, planar):
        model = model_of(planar)
        rough = estimate("weighted", model, recorded(model, 50, 5.0))
        result = trust(model, rough, [recorded(model, 500, 0.1, seed=2)])
        assert any("the description's own link parameters predict as well" in r for r in result.reasons)

    def test_a_recording_that_the_others_do_not_predict(self, good):
        model, found, validation = good
        odd = replace(validation, torque=1.5 * validation.torque)
        result = trust(model, found, [validation], folds("weighted", model, [validation, odd]))
        assert result.verdict == "usable" and "is predicted by the others" in result.reasons[0]

    def test_parameters_that_act_alike(self, good):
        model, found, validation = good
        result = trust(model, replace(found, condition=1e4), [validation])
        assert result.verdict == "usable" and "act alike" in result.reasons[0]

    def test_another_model(self, good):
        _, found, _ = good
        with pytest.raises(ShapeError, match="other parameters than the model"):
            trust(model_of(good[0].arm, offset=False), found)


@pytest.fixture(scope="module")
def candidates(planar):
    """Trajectories of which number 0 moves the first joint, 1 the second, 2 both a little."""
    trajectory = Trajectory(2, harmonics=3, period=8.0)
    c = torch.from_numpy(np.random.default_rng(5).uniform(-1, 1, (3, 2, 3, 2)))
    c[0, 1], c[1, 0] = 0, 0
    c[2] *= 0.1
    return trajectory, c


class TestNextRuns:
    def test_grams_are_weighted_information_per_sample(self, half_still, candidates):
        model, found, _ = half_still
        trajectory, c = candidates
        grams = grams_of(model, found, trajectory, c, samples=50)
        motion = trajectory.roll_out(c[:1], trajectory.grid(50))
        y = model.regressor(*(x[0] for x in motion[1:])) * certainty(found)[:, None]
        torch.testing.assert_close(grams[0], torch.einsum("sjp,sjq->pq", y, y) / 50)

    def test_the_still_joint_is_moved_first(self, half_still, candidates):
        model, found, _ = half_still
        grams = grams_of(model, found, *candidates)
        result = trust(model, found, grams=grams, samples_each=800, count=3).next_runs
        assert int(result.indices[0]) == 1
        assert (result.variance.diff() <= 0).all() and result.variance[0] < 0.1

    def test_the_first_pick_is_the_best_of_all(self, half_still, candidates):
        model, found, _ = half_still
        grams = grams_of(model, found, *candidates)
        effects = torch.ones(model.count, dtype=torch.float64)
        result = most_informative(found, grams, effects, samples=100, count=1)
        known = torch.linalg.inv(found.covariance)
        left = torch.stack([torch.linalg.inv(known + 100 * g).trace() for g in grams])
        assert int(result.indices[0]) == int(left.argmin())
        assert float(result.variance[0]) == pytest.approx(
            float(left.min() / found.covariance.trace()), rel=1e-4
        )

    def test_running_it_makes_deviations_as_small_as_promised(self, half_still, candidates):
        model, found, data = half_still
        trajectory, c = candidates
        effects = torch.ones(model.count, dtype=torch.float64)
        promised = most_informative(
            found, grams_of(model, found, trajectory, c), effects, samples=800, count=1
        )
        states = [x[0] for x in trajectory.roll_out(c[promised.indices], trajectory.times(100.0))[1:]]
        torque = model.torque(truth_of(model), *states)
        noise = NOISE * torch.from_numpy(np.random.default_rng(9).normal(size=torque.shape))
        after = estimate("weighted", model, [data, Measurements(*states, torque + noise)])
        ratio = float(after.covariance.trace() / found.covariance.trace())
        assert ratio == pytest.approx(float(promised.variance[0]), rel=0.3)

    def test_bad_input(self, half_still, candidates):
        model, found, _ = half_still
        with pytest.raises(ShapeError):
            grams_of(model, found, candidates[0], candidates[1][:, :1])
