import pytest
import torch

from sidegan.conditional.generator import Shaping, settle
from sidegan.gan.training import random_trajectories
from sidegan.validity import check


@pytest.fixture(scope="module")
def c(constraints, family, conditions):
    """Trajectories that use their position and velocity limits, whatever is in the way."""
    start = random_trajectories(constraints, family, 0)
    shaping = Shaping(constraints.arm, family, Shaping.reach_of(constraints.arm, family, start))
    return shaping(1.5 * start[: len(conditions)], conditions)


def valid(space, conditions, c):
    found = [
        check(
            conditions.row(k).constraints(space.constraints),
            conditions.row(k).family(space.trajectory),
            c[k : k + 1],
        ).valid
        for k in range(len(c))
    ]
    return torch.cat(found)


def test_settled_trajectories_keep_their_conditions_by_the_true_check(space, conditions, c):
    settled = settle(space, conditions, c)
    before, after = valid(space, conditions, c), valid(space, conditions, settled)
    assert before.double().mean() < 0.9 and after.all()
    assert (settled.abs().amax((1, 2, 3)) > 0).all()


def test_what_keeps_its_condition_stays_and_the_rest_only_shrinks(space, conditions, c):
    settled = settle(space, conditions, c)
    factor = settled.norm(dim=(2, 3)) / c.norm(dim=(2, 3))
    torch.testing.assert_close(factor, factor[:, :1].expand_as(factor))
    assert ((factor > 0) & (factor <= 1 + 1e-12)).all() and (factor[:, 0] == 1).any()
    torch.testing.assert_close(settle(space, conditions, settled), settled)


def test_one_batch_or_several_give_the_same(space, conditions, c):
    whole = settle(space, conditions.repeat(8), c.repeat_interleave(8, 0))
    torch.testing.assert_close(whole[::8], settle(space, conditions, c))
