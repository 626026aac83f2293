from dataclasses import replace

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.conditional.generator import Shaping
from sidegan.conditional.settings import Request
from sidegan.gan.training import random_trajectories
from sidegan.validity import Constraints, check


@pytest.fixture(scope="module")
def shaping(constraints, family):
    start = random_trajectories(constraints, family, 0)
    return Shaping(constraints.arm, family, Shaping.reach_of(constraints.arm, family, start))


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 999), size=st.sampled_from([0.01, 1.0, 30.0, 1e4]))
def test_position_and_velocity_limits_hold_whatever_is_asked_and_given(
    shaping, space, family, conditions, seed, size
):
    noise = torch.Generator().manual_seed(seed)
    c = shaping(size * torch.randn(len(conditions), 2, 3, 2, generator=noise), conditions)
    arm = space.constraints.arm
    for k in range(0, len(conditions), 4):
        share = replace(arm, velocity_limit=arm.velocity_limit * conditions.velocity[k])
        found = check(Constraints(share, torque=False), conditions.row(k).family(family), c[k : k + 1])
        assert float(found.margins["position"]) >= 0 and float(found.margins["velocity"]) >= 0


def test_a_neutral_condition_changes_no_size(shaping, space):
    torch.testing.assert_close(shaping.size(space.neutral(2)), torch.ones(2, 2, dtype=torch.float64))


def test_half_the_speed_is_at_most_half_the_size(shaping, space):
    slow, long = (space.condition(Request(**x)) for x in ({"velocity": 0.5}, {"period": 16.0}))
    assert (shaping.size(slow) <= 1).all() and (shaping.size(slow) >= 0.5).all()
    assert (shaping.size(long) <= 1).all() and (shaping.size(long) >= 0.5).all()


def test_small_motions_pass_unchanged(shaping, space):
    c = torch.full((1, 2, 3, 2), 1e-3)
    torch.testing.assert_close(shaping(c, space.neutral(1)), c, rtol=1e-4, atol=0)
