from dataclasses import replace

import pytest
import torch

from sidegan.conditional.settings import KINDS, Cube, Request
from sidegan.conditional.space import ConditionSpace
from sidegan.errors import ConfigError, InfeasibleError, ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints
from tests.conditional.conftest import CUBES, RANGES, random


def test_every_drawn_home_is_feasible_by_the_true_constraints(space, conditions):
    for k in range(len(conditions)):
        space.refuse(conditions.row(k))
        conditions.row(k).constraints(space.constraints).refuse_home(conditions.home[k].tolist())


@pytest.mark.parametrize("kind", KINDS)
def test_only_what_is_asked_for_differs_from_neutral(space, kind):
    drawn, base = space.draw(20, random(), (kind,)), space.neutral(20)
    other = {"effort": {"velocity", "torque"}}.get(kind, {kind})
    for name, x in drawn.columns().items():
        assert torch.allclose(x, getattr(base, name)) == (name not in other), name


def test_a_share_of_conditions_asks_for_each_kind(space):
    drawn, base = space.draw(2000, random()), space.neutral(2000)
    for name in ("period", "velocity", "links", "home"):
        x, y = getattr(drawn, name), getattr(base, name)
        assert 0.4 < float((x != y).reshape(2000, -1).any(1).double().mean()) < 0.6


def test_the_same_seed_draws_the_same(space):
    first, second = space.draw(5, random(3)), space.draw(5, random(3))
    torch.testing.assert_close(first.columns(), second.columns(), rtol=0, atol=0)


def test_codes_lie_between_minus_one_and_one_and_tell_conditions_apart(space, conditions):
    code = space.encode(conditions)
    assert code.shape == (12, space.size) and code.dtype == torch.float32
    assert (code.abs() <= 1).all()
    assert len(code.unique(dim=0)) == 12
    ends = space.encode(space.condition(Request(period=4, velocity=0.4, plane=0.1, walls=[0.4, 1.0])))[0]
    assert ends[2:8].tolist() == pytest.approx([-1, -1, 1, -1, -1, 1])


def test_what_cannot_be_asked_has_no_code(constraints, family):
    few = ConditionSpace(
        constraints, family, replace(RANGES, obstacle=None, links=False, plane=None, home=0.0)
    )
    assert few.size == 5
    assert (few.neutral(1).plane == -torch.inf).all()


def test_links_are_weighed_by_their_largest(space):
    assert space.condition(Request(links={"forearm": 3.0, "upper_arm": 1.5})).links.tolist() == [[0.5, 1.0]]
    with pytest.raises(ConfigError, match=r"'hand', expected some of upper_arm, forearm"):
        space.condition(Request(links={"hand": 1.0}))


@pytest.mark.parametrize(
    ("requested", "words"),
    [
        ({"period": 40.0}, r"period is \[40.0\], but the generator is trained for \[4.0\] to \[16.0\]"),
        ({"velocity": 0.2}, "velocity is"),
        ({"torque": 0.1}, "torque is"),
        ({"plane": 0.5}, "plane is"),
        ({"walls": [0.2, 0.5]}, "walls is"),
        ({"home": [0.0, 1.0]}, "home is"),
        ({"obstacle": Cube((0.0, 2.0, 1.0), 0.1)}, "obstacle is"),
    ],
)
def test_what_was_not_trained_is_refused(space, requested, words):
    with pytest.raises(ConfigError, match=words):
        space.refuse(space.condition(Request(**requested)))


def test_a_home_of_another_arm_or_no_number_is_refused(space, conditions):
    with pytest.raises(ShapeError, match="home"):
        space.refuse(conditions)
    with pytest.raises(ShapeError, match="not finite"):
        space.refuse(space.condition(Request(home=[0.0, float("nan")])))


def test_a_home_in_collision_is_refused_with_what_it_touches(constraints, family):
    wide = ConditionSpace(constraints, family, replace(RANGES, home=2.8))
    with pytest.raises(InfeasibleError, match=r"collision of base – forearm"):
        wide.refuse(wide.condition(Request(home=[0.0, 2.85 - 0.06])))


def test_an_obstacle_at_home_is_refused(space):
    with pytest.raises(InfeasibleError, match="home violates obstacle"):
        space.refuse(space.condition(Request(obstacle=Cube((0.0, 0.0, 1.2), 0.1))))


def test_an_obstacle_that_encloses_the_arm_is_refused(constraints, family):
    around = replace(CUBES, lower=(-0.8, -0.05, 0.2), half=(0.05, 3.0))
    space = ConditionSpace(constraints, family, replace(RANGES, obstacle=around))
    with pytest.raises(InfeasibleError, match="encloses the arm: upper_arm is never clear"):
        space.refuse(space.condition(Request(obstacle=Cube((0.0, 0.0, 0.8), 2.0))))


def test_a_plane_above_the_arm_is_refused(constraints, family):
    space = ConditionSpace(constraints, family, replace(RANGES, plane=(0.1, 0.9)))
    with pytest.raises(InfeasibleError, match=r"plane at 0.6 m leaves no room: upper_arm"):
        space.refuse(space.condition(Request(plane=0.6)))


def test_walls_within_the_arm_are_refused(constraints, family):
    space = ConditionSpace(constraints, family, replace(RANGES, walls=(0.01, 1.0)))
    with pytest.raises(InfeasibleError, match="walls leave no room: upper_arm"):
        space.refuse(space.condition(Request(walls=[1.0, 0.02])))


def test_gravity_beyond_the_torque_share_is_refused(planar, family):
    weak = Constraints(replace(planar, torque_limit=planar.torque_limit / 200))
    space = ConditionSpace(weak, family, replace(RANGES, plane=None))
    with pytest.raises(InfeasibleError, match="gravity alone takes"):
        space.refuse(space.condition(Request(home=[0.4, 0.0], torque=0.5)))


def test_ranges_that_leave_no_home_are_refused_with_the_reason(constraints, family):
    space = ConditionSpace(constraints, family, replace(RANGES, clearance=1.0))
    with pytest.raises(InfeasibleError, match=r"too close: walls"):
        space.draw(8, random(), ("walls",))


def test_a_period_must_be_possible_where_none_is_asked_for(constraints):
    with pytest.raises(ConfigError, match=r"a range around 20 s"):
        ConditionSpace(constraints, Trajectory(2, 3, 20.0), RANGES)
