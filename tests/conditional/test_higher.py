"""Conditional requests of an arm with limits of acceleration and jerk, at any period."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.conditional.generator import ConditionalGenerator, Shaping
from sidegan.conditional.problem import ConditionedProblem
from sidegan.conditional.settings import Request
from sidegan.conditional.space import ConditionSpace
from sidegan.design.penalty import Penalty
from sidegan.design.problem import Problem
from sidegan.errors import ArtifactError
from sidegan.gan.networks import Generator
from sidegan.gan.scaling import Scaling
from sidegan.gan.training import random_trajectories
from sidegan.validity import Constraints, check
from tests.conditional.conftest import RANGES, random
from tests.conditional.test_problem import directional
from tests.validity.critical import limited

SAMPLES = 24
BOTH = ["acceleration", "jerk"]


@pytest.fixture(scope="module")
def tight(constraints, family):
    """Conditions of the planar arm with limits that short periods violate."""
    arm = limited(constraints.arm, BOTH, 0.05)
    return ConditionSpace(Constraints(arm, constraints.regions), family, RANGES)


@pytest.fixture(scope="module")
def drawn(tight):
    return tight.draw(12, random())


@pytest.fixture(scope="module")
def start(tight, family):
    return random_trajectories(tight.constraints, family, 0)


@pytest.fixture(scope="module")
def shaping(tight, family, start):
    arm = tight.constraints.arm
    return Shaping(arm, family, Shaping.reach_of(arm, family, start))


@settings(max_examples=12, deadline=None)
@given(seed=st.integers(0, 999), size=st.sampled_from([0.01, 1.0, 30.0, 1e4]))
def test_the_limits_hold_whatever_is_asked_and_given(shaping, tight, family, drawn, seed, size):
    noise = torch.Generator().manual_seed(seed)
    c = shaping(size * torch.randn(len(drawn), 2, 3, 2, generator=noise), drawn)
    arm = tight.constraints.arm
    for k in range(0, len(drawn), 4):
        found = check(Constraints(arm, torque=False), drawn.row(k).family(family), c[k : k + 1]).margins
        assert all(float(found[name]) >= 0 for name in ("position", *BOTH))


def test_a_neutral_condition_changes_no_size_and_a_short_period_makes_it_smaller(shaping, tight):
    one = shaping.size(tight.neutral(2))
    torch.testing.assert_close(one, torch.ones(2, 2, dtype=torch.float64))
    short, long = (shaping.size(tight.condition(Request(period=x))) for x in (4.0, 12.0))
    assert (short <= 0.55).all() and (short >= 0.24).all()  # acceleration twice, jerk four times
    assert (long >= 1).any()


@pytest.fixture(scope="module")
def problem(tight, drawn, family):
    quiet = Constraints(tight.constraints.arm, tight.constraints.regions, torque=False)
    options = {"condition": drawn, "surroundings": tight.surroundings, "torque": True}
    return ConditionedProblem(quiet, family, SAMPLES, **options)


@pytest.fixture(scope="module")
def c(tight, family, drawn):
    return Problem(tight.constraints, family, SAMPLES).start(len(drawn), random(), 2.0)


def test_jerk_is_that_of_a_family_with_its_period(problem, family, drawn, c):
    states = problem.states(c)
    for k in range(len(c)):
        own = drawn.row(k).family(family)
        for order in (2, 3):
            expected = own.derivative(c[k : k + 1], own.grid(SAMPLES), order)[0]
            torch.testing.assert_close(states[order][k], expected, atol=1e-9, rtol=1e-9)


def test_gradients_of_the_violation_are_exact(problem, tight, c):
    penalty = Penalty(3.0, limits=0.0, torque=0.1, distance=0.2)
    found, expected = directional(lambda x: problem.violation(x, penalty), c)
    assert found == pytest.approx(expected, rel=1e-4) and abs(expected) > 1e-3
    none = Penalty(1.0, limits=0.0, torque=-10.0, distance=-10.0)
    arm = tight.constraints.arm
    for k, cost in enumerate(problem.violation(0.6 * c, none).tolist()):
        own = problem.condition.row(k).family(problem.trajectory)
        states = [own.derivative(0.6 * c[k : k + 1], own.grid(SAMPLES), order)[0] for order in range(4)]
        margins = Constraints(arm, torque=False).margins(*states)
        violated = any(bool((margins[name] < 0).any()) for name in ("position", "velocity", *BOTH))
        assert (cost > 0) == violated


def test_requests_keep_the_limits_and_a_file_says_how_many_there_are(tight, start, shaping, tmp_path):
    torch.manual_seed(0)
    scaling = Scaling.fit(start)
    network = Generator(2, 3, 10 + tight.size, "mlp", 16, shortcut=True, activation="silu")
    network.start_from(scaling.image(start))
    scaling = Scaling(scaling.mean.float(), scaling.spread.float())
    made = ConditionalGenerator(network.eval(), scaling, shaping.reach.float(), tight)
    made.save(tmp_path / "g.pt")
    loaded = ConditionalGenerator.load(tmp_path / "g.pt", tight.constraints)
    for request in (Request(), Request(period=4.5, velocity=0.6), Request(period=14.0)):
        condition = tight.condition(request)
        family, found = loaded.sample(20, condition, seed=1)
        assert torch.equal(found, made.sample(20, condition, seed=1)[1])
        margins = check(condition.constraints(tight.constraints), family, found).margins
        assert all((margins[name] >= 0).all() for name in ("position", "velocity", *BOTH))
    cut = ConditionalGenerator(made.network, scaling, shaping.reach[:2].float(), tight)
    cut.save(tmp_path / "cut.pt")
    with pytest.raises(ArtifactError, match="contradicts itself"):
        ConditionalGenerator.load(tmp_path / "cut.pt", tight.constraints)
