from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from sidegan.errors import ConfigError
from sidegan.identification import Noise, Recursion, measure, study
from sidegan.identification.model import RIGID, TorqueModel
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.moves import pick_and_place
from sidegan.motion.trajectory import Trajectory
from tests.identification.recordings import NOISE, study_settings
from tests.identification.test_fit import classical


@pytest.fixture(scope="module")
def body(planar):
    return RigidBody(planar)


@pytest.fixture(scope="module")
def families():
    """Two excitation sets of different families, and tests."""
    random = torch.Generator().manual_seed(0)
    short, long = Trajectory(2, 3, 8.0), Trajectory(2, 6, 16.0)

    def draw(family, count):
        return family, 0.5 * torch.randn(count, *family.shape, generator=random, dtype=torch.float64)

    return {"long-6": draw(long, 1), "seeds": draw(short, 2)}, draw(short, 3)


def compare(body, families, seed=0, **changes):
    return study.compare(body, *families, study_settings(**changes), np.random.SeedSequence(seed))


def test_without_noise_every_set_recovers_the_arm(body, families):
    results, _ = compare(body, families, noise=replace(NOISE, level=0.0))
    assert results.nmse.max() < 1e-8


def test_there_is_a_row_for_everything(body, families, planar):
    told = []
    results, facts = study.compare(
        body, *families, study_settings(), np.random.SeedSequence(0), lambda *x: told.append(x)
    )
    assert list(results.columns) == ["set", "repeat", "weighted", "joint", "nmse"]
    assert (
        len(results) == 2 * 2 * 2 * 2 == len(results.drop_duplicates(["set", "repeat", "weighted", "joint"]))
    )
    assert set(results.joint) == set(planar.joint_names)
    assert list(facts.columns) == ["set", "repeat", "covariance_norm", "condition", "duration", "samples"]
    assert len(facts) == 4
    assert dict(zip(facts["set"], facts.duration)) == {"long-6": 16.0, "seeds": 16.0}
    assert dict(zip(facts["set"], facts.samples)) == {"long-6": 321, "seeds": 322}
    assert (facts.condition > 1).all() and (facts.covariance_norm > 0).all()
    assert told == [(1, 4), (2, 4), (3, 4), (4, 4)]


def test_progress_counts_every_repeat_of_every_set(body, families):
    told, settings = [], study_settings(repeats=3)
    random = np.random.SeedSequence(0)
    study.compare(body, *families, settings, random, lambda *x: told.append(x))
    assert told == [(k, 6) for k in range(1, 7)]


def test_a_repeat_draws_the_same_noise_for_every_set(body, families):
    """The same set under two names cannot be told apart, and neither by who stands beside it."""
    sets, tests = families
    twice = {"a": sets["seeds"], "long-6": sets["long-6"], "b": sets["seeds"]}
    results, facts = compare(body, (twice, tests))
    table = results.set_index(["set", "repeat", "weighted", "joint"]).nmse
    pd.testing.assert_series_equal(table["a"], table["b"])
    pd.testing.assert_series_equal(
        facts[facts["set"] == "a"].covariance_norm,
        facts[facts["set"] == "b"].covariance_norm,
        check_index=False,
    )
    alone, _ = compare(body, ({"b": sets["seeds"]}, tests))
    pd.testing.assert_series_equal(table["b"], alone.set_index(["repeat", "weighted", "joint"]).nmse)


def test_repeats_and_seeds_draw_different_noise(body, families):
    results, _ = compare(body, families)
    table = results[~results.weighted].pivot_table("nmse", ["set", "joint"], "repeat")
    assert (table[0] != table[1]).all()
    again, _ = compare(body, families)
    pd.testing.assert_frame_equal(results, again)
    other, _ = compare(body, families, seed=1)
    assert (results.nmse != other.nmse).all()


def test_weighting_is_left_out_when_it_is_not_wanted(body, families):
    results, _ = compare(body, families, weighted=False, repeats=1)
    assert not results.weighted.any() and len(results) == 4


def test_more_noise_gives_more_error(body, families):
    errors = [
        compare(body, families, noise=replace(NOISE, level=level))[0].nmse.mean() for level in (0.01, 0.3)
    ]
    assert errors[0] < errors[1]


def test_a_short_period_does_not_hide_its_harmonics_from_the_condition(body):
    """At a fixed rate one second of six harmonics would be aliased."""
    random = torch.Generator().manual_seed(1)
    slow, fast = Trajectory(2, 6, 16.0), Trajectory(2, 6, 1.0)
    c = 0.3 * torch.randn(1, 2, 6, 2, generator=random, dtype=torch.float64)
    for family in (slow, fast):
        fine = study._stacked_condition(body, (family, c))
        exact = float(study.excitation_of(body, study.gram(body, family, c, 2000)).eigenvalue_fitness[0])
        assert fine == pytest.approx(exact, rel=0.05)


class TestReplication:
    def test_sums_of_sets_identify_like_the_sets_together(self, body, families):
        """Without noise on states the sums are those of the samples, in whatever order they were added."""
        sets, tests = families
        exact = study_settings(noise=replace(NOISE, level=0.0), prior=1e12)
        told = []
        seeds, long = (
            study.measured_sums(body, sets[name], exact, np.random.SeedSequence(0), lambda *x: told.append(x))
            for name in ("seeds", "long-6")
        )
        assert told == [(2, 2), (1, 1)]
        results, facts = study.combined(body, {"one": [seeds], "both": [seeds, long]}, tests, exact)
        assert results.nmse.max() < 1e-8
        assert list(results.columns) == ["set", "weighted", "joint", "nmse"] and len(results) == 2 * 2 * 2
        samples = dict(zip(facts["set"], facts.samples))
        assert samples == {"one": 322, "both": 322 + 321}
        norms = dict(zip(facts["set"], facts.covariance_norm))
        assert norms["both"] < norms["one"]

    def test_what_cannot_be_added_is_refused(self, body, families):
        sets, tests = families
        sums = study.measured_sums(body, sets["seeds"], study_settings(), np.random.SeedSequence(0))
        with pytest.raises(ConfigError, match=r"forgetting factor 0.9, expected 1"):
            study.combined(body, {"a": [sums]}, tests, study_settings(forgetting=0.9))


class TestRecursions:
    """Covariance norms of a set under other priors and forgetting factors."""

    EXACT = replace(NOISE, level=0.0)

    def norms(self, body, family, *recursions, noise=EXACT):
        settings, random = study_settings(noise=noise), np.random.SeedSequence(0)
        whole = study.measured_sums(body, family, settings, random)
        chosen = [Recursion(*one) for one in recursions]
        return study.covariance_norms(body, family, whole, chosen, settings, np.random.SeedSequence(1))

    @pytest.mark.parametrize("prior", [1e6, 1.0, 1e-6])
    @pytest.mark.parametrize("forgetting", [1.0, 0.999, 0.98])
    def test_the_classical_recursion_sample_by_sample(self, body, families, prior, forgetting):
        trajectory, c = family = families[0]["seeds"]
        times = trajectory.times(study_settings().rate)
        data = measure(body, trajectory.roll_out(c, times))
        y = TorqueModel(body, RIGID).regressor(*data.states)
        _, covariance = classical(y, data.torque, prior, forgetting)
        (norm,) = self.norms(body, family, (prior, forgetting))
        assert norm == pytest.approx(np.linalg.norm(np.diag(covariance)), rel=1e-4)

    def test_more_of_the_same_trajectories_do_not_change_a_norm_that_forgets(self, body, families):
        trajectory, c = families[0]["seeds"]
        recursions = (1e6, 0.9), (1e6, 1.0), (1e-12, 1.0)
        once, often = (self.norms(body, (trajectory, c.repeat(k, 1, 1, 1)), *recursions) for k in (2, 8))
        assert often[0] == pytest.approx(once[0], rel=1e-6)
        assert often[1] == pytest.approx(once[1] / 4, rel=1e-3)
        assert often[2] == pytest.approx(once[2], rel=1e-6)  # nothing is known but the prior

    def test_only_what_is_remembered_is_measured(self, body, families, monkeypatch):
        """The last trajectories give the norm of all of them, and no other one is rolled out."""
        trajectory, c = families[0]["seeds"]
        many, forgetting = c.repeat(20, 1, 1, 1), 0.97
        rolled, roll_out = [], Trajectory.roll_out

        def counted(self, c, times):
            rolled.append(len(c))
            return roll_out(self, c, times)

        whole = study.measured_sums(
            body, (trajectory, many), study_settings(noise=self.EXACT), np.random.SeedSequence(0)
        )
        monkeypatch.setattr(Trajectory, "roll_out", counted)
        settings, random = study_settings(noise=self.EXACT), np.random.SeedSequence(0)
        chosen = [Recursion(1e6, forgetting), Recursion(1.0, forgetting)]
        study.covariance_norms(body, (trajectory, many), whole, chosen, settings, random)
        memory = np.log(np.finfo(float).eps) / np.log(forgetting)
        assert sum(rolled) == np.ceil(memory / len(trajectory.times(settings.rate))) < len(many)

    def test_the_order_of_a_set_matters_where_it_is_forgotten(self, body, families):
        trajectory, c = families[0]["seeds"]
        ahead, back = (self.norms(body, (trajectory, x), (1e6, 0.95), (1e6, 1.0)) for x in (c, c.flip(0)))
        assert ahead[0] != pytest.approx(back[0], rel=1e-3)
        assert ahead[1] == pytest.approx(back[1], rel=1e-6)


class TestElsewhere:
    """Models tested on other motions than those that they are identified from."""

    def kinds(self, body, families):
        trajectory, c = families[1]
        times = trajectory.times(20.0)
        points = torch.tensor([[0.0, 0.0], [0.5, -0.7], [-0.4, 0.9]], dtype=torch.float64)
        moves = pick_and_place(points, torch.tensor([1.0, 1.5], dtype=torch.float64), 0.2, 20.0)
        slow = [measure(body, trajectory.roll_out(0.3 * one[None], times)) for one in c]
        return {"slow": slow, "moves": measure(body, moves)}

    def errors(self, body, families, level):
        settings = study_settings(noise=replace(NOISE, level=level))
        random = np.random.SeedSequence(0)
        return study.errors_on(body, families[0]["seeds"], self.kinds(body, families), settings, random)

    def test_without_noise_the_arm_is_recovered_on_every_kind_of_test(self, body, families):
        errors = self.errors(body, families, 0.0)
        assert errors.groupby("test").nmse.max().lt(1e-8).all() and set(errors.test) == {"slow", "moves"}
        assert errors.share.max() < 1e-4

    def test_the_models_are_those_of_the_comparison(self, body, families):
        trajectory, c = families[1]
        times = trajectory.times(study_settings().rate)
        tests = {"same": [measure(body, trajectory.roll_out(one[None], times)) for one in c]}
        settings, random = study_settings(), np.random.SeedSequence(0)
        found = study.errors_on(body, families[0]["seeds"], tests, settings, random)
        table, _ = compare(body, ({"seeds": families[0]["seeds"]}, families[1]))
        keys = ["repeat", "weighted", "joint"]
        both = found.merge(table, on=keys)
        assert len(both) == len(found) == len(table)
        assert both.nmse_x.to_numpy() == pytest.approx(both.nmse_y.to_numpy(), rel=1e-6)

    def test_an_error_is_a_share_of_the_limit_or_of_the_largest_torque(self, planar, families):
        """Where the limit is half as large, the share is twice."""
        body = RigidBody(planar)
        tests = self.kinds(body, families)
        largest = torch.stack([part.torque.abs().amax(0) for part in tests["slow"]]).amax(0)
        unlimited = torch.full_like(largest, torch.inf)
        limited = torch.where(torch.tensor([True, False]), largest / 2, unlimited)
        settings, seeds = study_settings(repeats=1), families[0]["seeds"]

        def shares(limit):
            body = RigidBody(replace(planar, torque_limit=limit))
            errors = study.errors_on(body, seeds, tests, settings, np.random.SeedSequence(0))
            return errors[errors.test == "slow"].groupby("joint", sort=False).share.mean()

        first, second = shares(limited), shares(unlimited)
        assert (first / second).to_numpy() == pytest.approx([2.0, 1.0])


def test_noise_on_nothing_is_exact():
    assert Noise("additive", 0.0, torque=True, state=True).exact
    assert Noise("additive", 0.1, torque=False, state=False).exact
    assert not NOISE.exact


@pytest.mark.parametrize("kind", ["multiplicative", "additive"])
def test_errors_over_many_draws_are_those_expected(body, families, kind):
    sets, tests = families
    settings = study_settings(noise=replace(NOISE, kind=kind, torque=True, state=False), repeats=150)
    drawn, _ = study.compare(body, {"seeds": sets["seeds"]}, tests, settings, np.random.SeedSequence(1))
    nmse = drawn.groupby(["weighted", "joint"]).nmse
    expected = study.expected(body, sets["seeds"], tests, settings).set_index(["weighted", "joint"]).nmse
    apart = (nmse.mean() - expected.loc[nmse.mean().index]) / nmse.sem()
    assert len(apart) == 4 and (apart.abs() < 4).all()
    assert (nmse.sem() < 0.1 * nmse.mean()).all()  # so that the comparison says something


def test_nothing_is_expected_where_states_are_noisy(body, families):
    sets, tests = families
    noise = replace(NOISE, torque=True, state=True)
    assert study.expected(body, sets["seeds"], tests, study_settings(noise=noise)).empty
    quiet = study.expected(body, sets["seeds"], tests, study_settings(noise=replace(noise, level=0.0)))
    assert quiet.nmse.max() < 1e-8
