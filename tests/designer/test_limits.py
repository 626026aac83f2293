"""What a designer keeps besides planes and boxes: obstacles, clearance, pieces of links, more limits."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.designer import Aim, Designer, Situation
from sidegan.designer.proof import CheckProver, Prover
from sidegan.designer.scene import ArmNumbers
from sidegan.errors import InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER
from sidegan.validity import Box, Constraints, Convex, Plane, Sphere, check
from tests.validity.critical import limited
from tests.validity.test_pieces import filled

from .conftest import BOX, DESK, HOME
from .test_objective import PENALTIES, assert_gradient, assert_plain_torch_agrees, point

BALL = Sphere((0.4, 0.2, 0.5), 0.15)
BODY = Convex.between((-0.5, -0.4, 0.2), (-0.3, -0.2, 0.9), 0.1)
POLE = Convex.between((0.5, -0.5, 0.1), (0.5, -0.5, 0.8), 0.05)
OBSTACLES = {"ball": (BALL,), "body": (BODY,), "all": (BODY, BOX, BALL, POLE)}
FEW = 30


def assert_valid(design, constraints):
    """By the usual check of the usual constraints."""
    assert design.coefficients is not None, design.blocked
    found = check(constraints, design.trajectory, design.coefficients[None])
    assert bool(found.valid[0]), found.failures(0)
    assert set(found.margins) == set(design.margins)


def assert_same(shapes, expected):
    for one, other in zip(shapes, expected):
        np.testing.assert_allclose(one, other)


@pytest.mark.parametrize("regions", OBSTACLES.values(), ids=OBSTACLES)
def test_balls_and_convex_bodies_are_kept_out_of(arm, designer, regions):
    design = designer.ask(Situation(HOME, regions), evaluations=FEW)
    constraints = Constraints(arm, [DESK, *regions])
    assert_valid(design, constraints)
    assert constraints.guarded.tolist() == design.scene.shapes.guarded.tolist()
    assert_same(design.scene.shapes, constraints.shapes)


def test_bodies_of_the_workspace_and_of_the_situation_stand_side_by_side(arm):
    numbers = ArmNumbers(Constraints(arm, [DESK, BODY, BALL], clearance=0.01), Trajectory(7))
    scene = numbers.scene(Situation(regions=[POLE, BOX, BODY]))
    assert_same(scene.shapes, Constraints(arm, [DESK, BODY, BALL, POLE, BOX, BODY], clearance=0.01).shapes)


@pytest.mark.parametrize("regions", OBSTACLES.values(), ids=OBSTACLES)
def test_what_they_cost_is_what_plain_torch_says(designer, settings, regions):
    pytest.importorskip("numba")
    scene = designer.numbers.scene(Situation(regions=regions, velocity=0.8, clearance=0.01))
    x = point(designer.numbers, scene, 3)
    assert_gradient(designer.descents.descent(scene, Aim(), PENALTIES), x)
    assert_plain_torch_agrees(designer.numbers, settings, scene, x, Aim())


def test_a_ball_around_the_arm_is_told(designer):
    blocked = designer.ask(Situation(regions=[Sphere((0.0, 0.0, 0.5), 3.0)]), evaluations=FEW).blocked
    assert "no link is ever outside" in blocked[0]


@pytest.mark.parametrize("clearance", [0.0, 0.01, 0.03])
def test_the_clearance_of_the_workspace_is_kept_and_the_larger_one_counts(arm, settings, starts, clearance):
    designer = Designer(Constraints(arm, [DESK], clearance=0.02), Trajectory(7), settings, starts)
    design = designer.ask(Situation(HOME, [BOX, BALL], clearance=clearance), evaluations=FEW)
    usual = Constraints(arm, [DESK, BOX, BALL], clearance=max(clearance, 0.02))
    assert design.constraints.clearance == usual.clearance
    assert_valid(design, usual)


@pytest.fixture
def full(arm):
    """An arm with something inside of its capsules, which are much too large."""
    capsules = filled(arm, 3).capsules
    pieces = replace(capsules.pieces, exact=torch.zeros_like(capsules.pieces.exact))
    return replace(arm, capsules=replace(capsules, radius=1.4 * capsules.radius, pieces=pieces))


@pytest.mark.parametrize("clearance", [0.0, 0.02])
def test_what_is_inside_of_capsules_counts_as_in_the_check(full, clearance):
    numbers = ArmNumbers(Constraints(full, [DESK]), Trajectory(7))
    assert numbers.constraints.pieces.finer.any()
    assert_proofs_are_the_check(numbers, Situation(regions=[BALL], clearance=clearance))


@pytest.mark.parametrize("names", [[], ["acceleration"], ["jerk"], ["acceleration", "jerk"]])
@pytest.mark.parametrize("period", [16.0, 5.0])
def test_all_limits_count_as_in_the_check(arm, names, period):
    numbers = ArmNumbers(Constraints(limited(arm, names, 0.5), [DESK]), Trajectory(7))
    assert_proofs_are_the_check(numbers, Situation(HOME, [BOX], period=period))


def assert_proofs_are_the_check(numbers, situation):
    """Without overhead, of random trajectories of which some are valid."""
    scene = numbers.scene(situation)
    pytest.importorskip("numba")
    fast, whole = Prover(numbers), CheckProver(numbers)
    random, valid = np.random.default_rng(0), []
    for _ in range(12):
        x = random.standard_normal(scene.size.shape) * random.uniform(0.05, 0.6)
        c = numbers.within(scene, (x * scene.size) @ numbers.turn.T, 0.9)
        one, other = fast.prove(scene, c), whole.prove(scene, c)
        assert one.valid == other.valid
        valid.append(one.valid)
        if one.valid:
            np.testing.assert_allclose(one.margins, other.margins, atol=1e-6)
    assert any(valid) and not all(valid)


@pytest.mark.parametrize("clearance", [0.0, 0.02])
def test_what_is_inside_of_capsules_grows_with_the_clearance(full, clearance):
    pytest.importorskip("numba")
    numbers = ArmNumbers(Constraints(full, [DESK]), Trajectory(7))
    model = Prover(numbers).model(numbers.scene(Situation(regions=[BALL], clearance=clearance)))
    usual = Constraints(full, [DESK, BALL], clearance=clearance)
    assert_same(model.hulls, usual.pieces.hulls())
    assert_same(model.shapes, usual.shapes)


def test_an_arm_with_something_inside_of_capsules_is_designed_for(full, settings):
    designer = Designer(Constraints(full, [DESK]), Trajectory(7), settings)
    design = designer.ask(Situation(regions=[BALL], clearance=0.01), evaluations=60)
    assert_valid(design, Constraints(full, [DESK, BALL], clearance=0.01))


@pytest.mark.parametrize("names", [["acceleration"], ["jerk"], ["acceleration", "jerk"]])
@pytest.mark.parametrize("period", [16.0, 5.0])
def test_accelerations_and_jerks_keep_their_limits(arm, settings, starts, names, period):
    tight = limited(arm, names, 0.1)
    designer = Designer(Constraints(tight, [DESK]), Trajectory(7), settings, starts)
    design = designer.ask(Situation(HOME, [BOX], period=period), evaluations=FEW)
    assert_valid(design, Constraints(tight, [DESK, BOX]))
    assert set(names) <= set(design.margins)
    times = design.trajectory.times(1000.0)
    used = [
        (design.trajectory.derivative(design.coefficients[None], times, HIGHER[name]).abs() / limit).max()
        for name, limit in designer.numbers.constraints.higher.items()
    ]
    assert 0.3 < max(used) <= 1  # which are what holds it back


def test_without_kernels_all_of_that_is_kept_too(planar, settings, monkeypatch):
    monkeypatch.setenv("SIDEGAN_KERNELS", "torch")
    tight = limited(planar, ["acceleration", "jerk"], 0.2)
    ball = Sphere((1.4, 0.0, 1.1), 0.2)
    designer = Designer(Constraints(tight, clearance=0.01), Trajectory(2, 3, 8.0), settings)
    design = designer.ask(Situation(regions=[ball, Box((1.2, -1, 0.9), (1.6, 1, 1.2))]), evaluations=12)
    assert design.coefficients is not None and torch.isfinite(design.coefficients).all()
    assert_valid(design, Constraints(tight, [ball, Box((1.2, -1, 0.9), (1.6, 1, 1.2))], clearance=0.01))


LOW = Plane((0, 0, 1), 0.35)  # from which the planar arm's upper arm is never 0.2 m away


@pytest.mark.parametrize("apart", [None, 0.0])
def test_a_clearance_that_somebody_asks_for_is_kept_by_every_link(planar, settings, apart):
    designer = Designer(Constraints(planar, [LOW], apart=apart), Trajectory(2, 3, 8.0), settings)
    design = designer.ask(Situation(clearance=0.2), evaluations=1)
    assert design.coefficients is None
    assert any("upper_arm in region 0" in line for line in design.blocked), design.blocked


@pytest.mark.parametrize(("usual", "apart"), [(0.0, 0.0), (0.005, 0.0), (0.005, 0.005)])
def test_a_clearance_that_links_with_pieces_never_have_is_refused(full, usual, apart):
    numbers = ArmNumbers(
        Constraints(full, [Plane((0, 0, 1), 0.44)], clearance=usual, apart=apart), Trajectory(7)
    )
    numbers.scene(Situation(clearance=0.006))
    with pytest.raises(InfeasibleError, match=r"clearance of 0\.06 m cannot be kept.*link_3 in region 0"):
        numbers.scene(Situation(clearance=0.06))


@pytest.mark.parametrize("apart", [0.0, 0.2])
def test_what_is_near_by_nature_stays_so_and_a_larger_clearance_is_refused(planar, apart):
    usual = Constraints(planar, [LOW], clearance=0.2, apart=apart)
    numbers = ArmNumbers(usual, Trajectory(2, 3, 8.0))
    assert numbers.scene(Situation()).shapes is usual.shapes
    with pytest.raises(InfeasibleError, match=r"clearance of 0\.21 m cannot be kept.*upper_arm in region 0"):
        numbers.scene(Situation(clearance=0.21))
