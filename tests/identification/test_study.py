from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import torch

from sidegan.errors import ConfigError
from sidegan.identification import study
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from tests.identification.recordings import NOISE, study_settings


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
