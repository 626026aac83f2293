"""Studies of sets in simulation, and the noise of their measurements."""

import itertools
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest

from sidegan.identification import RIGID, Noise, TorqueModel, add_noise, exact_measurements, study
from sidegan.identification.fit import gather
from sidegan.motion.trajectory import Trajectory
from tests.identification.recordings import NOISE, study_settings

EXACT = replace(NOISE, level=0.0)


@pytest.fixture(scope="module")
def families():
    """Two excitation sets of different families, and tests."""
    random = np.random.default_rng(0)
    short, long = Trajectory(2, 3, 8.0), Trajectory(2, 6, 16.0)

    def draw(family, count):
        return family, 0.5 * random.standard_normal((count, *family.shape))

    return {"long-6": draw(long, 1), "seeds": draw(short, 2)}, draw(short, 3)


def drawn(body, family, tests, seed=0, **changes):
    settings, random = study_settings(**changes), np.random.SeedSequence(seed)
    return study.drawn_errors(body, "set", family, tests, settings, random, lambda *_: None)


def summed(body, family, settings, randoms):
    return study.measured_sums(body, family, settings, randoms, lambda *_: None)


def test_results_have_a_row_per_repeat_weighting_and_joint(body, families, planar):
    progressed, random, (sets, tests) = [], np.random.SeedSequence(0), families
    results, facts = study.drawn_errors(
        body, "seeds", sets["seeds"], tests, study_settings(), random, lambda *done: progressed.append(done)
    )
    rows = itertools.product(["seeds"], range(2), (False, True), planar.joint_names)
    found = results[["set", "repeat", "weighted", "joint"]].itertuples(index=False)
    assert set(found) == set(rows) and len(results) == 8
    assert progressed == [(2, 2)]
    assert facts["set"].tolist() == ["seeds"] * 2 and facts.repeat.tolist() == [0, 1]
    assert facts.duration.tolist() == [16.0] * 2 and facts.samples.tolist() == [322] * 2
    assert (facts.condition > 1).all() and (facts.covariance_norm > 0).all()


def test_noise_depends_on_repeat_and_seed(body, families):
    sets, tests = families
    first, again, other = (drawn(body, sets["seeds"], tests, seed)[0] for seed in (0, 0, 1))
    pd.testing.assert_frame_equal(first, again)
    assert (first.nmse != other.nmse).all()
    assert (first[first.repeat == 0].nmse.to_numpy() != first[first.repeat == 1].nmse.to_numpy()).all()


def test_summed_sets_identify_like_the_union(body, families):
    """Without noise on states the sums are those of the samples, in whatever order they were added."""
    sets, tests = families
    exact = study_settings(noise=EXACT, prior=1e12)
    random = np.random.SeedSequence(0)
    (seeds,), (long,) = (summed(body, sets[name], exact, [random]) for name in ("seeds", "long-6"))
    results, facts = study.combined_errors(body, {"one": [seeds], "both": [seeds, long]}, tests, exact)
    assert results.nmse.max() < 1e-8 and len(results) == 2 * 2 * 2
    facts = facts.set_index("set")
    assert facts.samples.to_dict() == {"one": 322, "both": 322 + 321}
    assert facts.covariance_norm["both"] < facts.covariance_norm["one"]


def test_draws_sharing_a_regressor_have_the_same_sums_as_alone(body, families):
    noisy, draws = study_settings(), np.random.SeedSequence(3).spawn(3)
    together = summed(body, families[0]["seeds"], noisy, draws)
    family, c = families[0]["seeds"]
    exact = exact_measurements(body, family.roll_out(c, family.times(noisy.rate)))
    for sums, draw in zip(together, draws, strict=True):
        samples = add_noise(exact, noisy.noise, np.random.default_rng(draw), len(c))
        for found, wanted in zip(sums, gather(TorqueModel(body, RIGID), samples).sums):
            np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-9)


def test_mean_errors_over_draws_are_the_expected_ones(body, families):
    sets, (trajectory, c) = families
    tests = trajectory, c[:1]
    settings = study_settings(repeats=150)
    results, _ = drawn(body, sets["seeds"], tests, seed=1, repeats=150)
    nmse = results.groupby(["weighted", "joint"]).nmse
    expected = study.expected_errors(body, sets["seeds"], tests, settings).set_index(["weighted", "joint"])
    apart = (nmse.mean() - expected.nmse) / nmse.sem()
    assert len(apart) == 4 and (np.abs(apart) < 4).all()
    assert (nmse.sem() < 0.1 * nmse.mean()).all()  # so that the comparison says something


def test_no_expected_error_with_noisy_states(body, families):
    sets, tests = families
    noise = replace(NOISE, state=True)
    assert study.expected_errors(body, sets["seeds"], tests, study_settings(noise=noise)).empty
    quiet = study.expected_errors(body, sets["seeds"], tests, study_settings(noise=EXACT))
    assert quiet.nmse.max() < 1e-8


def stack(measurements):
    return np.stack([*measurements.states, measurements.torque])


@pytest.fixture(scope="module")
def motion():
    """Two trajectories of 150 samples, (2, 150, 2)."""
    family = Trajectory(2, 3, 3.0)
    c = np.random.default_rng(7).normal(size=(2, *family.shape))
    return family.roll_out(c, family.times(149 / 3))


def test_noise_is_uniform_relative_to_the_signal(body, motion):
    exact = exact_measurements(body, motion)
    clean = stack(exact)
    added = stack(add_noise(exact, Noise(state=True), np.random.default_rng(1))) - clean
    moving = clean != 0  # at rest there is none
    share = added[moving] / clean[moving]
    assert 0.0995 < np.abs(share).max() <= 0.1 + 1e-9
    # U(−0.1, 0.1) has mean 0 and standard deviation 0.1 / √3: 2400 draws, five standard errors.
    assert abs(share.mean()) < 5 * 0.1 / np.sqrt(3 * 2400)
    assert share.std() == pytest.approx(0.1 / np.sqrt(3), rel=0.05)


def test_the_noise_of_a_signal_does_not_depend_on_other_signals(body, motion):
    clean = exact_measurements(body, motion)
    assert all(np.array_equal(x, true.reshape(300, 2)) for x, true in zip(clean.states, motion[1:]))
    torque, state, both = (
        add_noise(clean, Noise(torque=noisy[0], state=noisy[1]), np.random.default_rng(1))
        for noisy in ((True, False), (False, True), (True, True))
    )
    assert all(np.array_equal(x, y) for x, y in zip(torque.states, clean.states))
    assert np.array_equal(state.torque, clean.torque)  # the torque of the true states
    assert np.array_equal(both.torque, torque.torque)
    assert all(np.array_equal(x, y) for x, y in zip(both.states, state.states))
    assert not np.array_equal(both.position, clean.position)


def test_a_batch_is_measured_like_its_trajectories_in_turn(body, motion):
    exact, noise, random = exact_measurements(body, motion), Noise(state=True), np.random.default_rng(5)
    whole = stack(add_noise(exact, noise, np.random.default_rng(5), batch=2))
    parts = [stack(add_noise(part, noise, random)) for part in (exact[:150], exact[150:])]
    np.testing.assert_array_equal(whole, np.concatenate(parts, 1))
