"""What a designer answers: proven by another author's physics, the same again, in time, or why not."""

from dataclasses import replace
from itertools import combinations, count
from unittest.mock import Mock

import coal
import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.design.excitation import excite
from sidegan.design.information import information_of
from sidegan.designer import Aim, Designer
from sidegan.designer.proof import Prover
from sidegan.errors import ConfigError, InfeasibleError, ShapeError
from sidegan.identification import TorqueModel
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER as ORDERS
from sidegan.robot.oracle import capsule_geometry, pinocchio_model
from sidegan.validity import Box, Constraints, Plane, Sphere, check
from sidegan.validity.constraints import NAMES
from tests.validity.critical import limited

from .conftest import CASES, HIGHER, scene_of, slow

RATE = 100.0  # [Hz]
FEW = 60  # evaluations
ORACLE = [case for case in CASES if case not in ("bodies", "pieces", "pieces apart")]


def ticking(step):
    """A clock that goes on by a fixed step whenever it is read."""
    return (step * n for n in count()).__next__


def assert_valid(design):
    """By the usual check, which gives the margins that the answer has."""
    assert design.coefficients is not None and not design.blocked, design.blocked
    found = check(design.constraints, design.trajectory, design.coefficients[None])
    assert bool(found.valid[0]), found.failures(0)
    assert {name: float(x[0]) for name, x in found.margins.items()} == pytest.approx(design.margins, abs=1e-6)


def region_distance(region, geometry, data, guarded):
    """Smallest distance [m] of capsules from a region, by coal."""
    if isinstance(region, Plane):
        shape = coal.Halfspace(np.array(region.unit), region.offset)
        placement = coal.Transform3s()
    else:
        low, high = np.array(region.lower), np.array(region.upper)
        shape, placement = coal.Box(*(high - low)), coal.Transform3s(np.eye(3), (low + high) / 2)
    distances = []
    for k in guarded:
        where = coal.Transform3s(data.oMg[k].rotation, data.oMg[k].translation)
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        one = geometry.geometryObjects[k].geometry
        distances.append(coal.distance(one, where, shape, placement, request, result))
    return min(distances)


@pytest.mark.parametrize("case", ORACLE)
def test_every_answer_is_valid_by_pinocchio_and_coal(designer_of, case):
    design = designer_of(case).ask(evaluations=FEW)
    assert_valid(design)
    constraints, trajectory = design.constraints, design.trajectory
    arm, guarded, used = constraints.arm, constraints.guarded, []
    motion = trajectory.roll_out(design.coefficients[None], trajectory.times(RATE))
    q, dq, ddq = (x[0].numpy() for x in motion[1:])
    np.testing.assert_allclose(q[[0, -1]], [trajectory.home] * 2, atol=1e-9)
    assert (q >= arm.position_lower.numpy()).all() and (q <= arm.position_upper.numpy()).all()
    assert (np.abs(dq) <= arm.velocity_limit.numpy()).all()
    for name, limit in constraints.higher.items():
        states = trajectory.derivative(design.coefficients[None], trajectory.times(1000.0), ORDERS[name])
        used.append(float((states.abs() / limit).max()))
    assert not used or 0.3 < max(used) <= 1  # they are what holds it back
    model, geometry = pinocchio_model(arm), capsule_geometry(arm)
    data = model.createData()
    for first, second in constraints.pairs.tolist():
        geometry.addCollisionPair(pin.CollisionPair(first, second))
    shapes = geometry.createData()
    for k in range(len(q)):
        torque = np.abs(pin.rnea(model, data, q[k], dq[k], ddq[k]))
        assert (torque <= arm.torque_limit.numpy()).all() or not constraints.torque
        pin.computeDistances(model, data, geometry, shapes, q[k])
        assert min(x.min_distance for x in shapes.distanceResults) >= -1e-6
        for number, region in enumerate(constraints.regions):
            own = guarded[guarded[:, 0] == number, 1].tolist()
            assert region_distance(region, geometry, shapes, own) >= -1e-6


@pytest.mark.parametrize("evaluations", [1, 7, FEW])
@pytest.mark.parametrize("case", ["desk", "bodies", "pieces apart"])
def test_every_answer_is_valid_by_the_usual_check(designer_of, case, evaluations):
    assert_valid(designer_of(case).ask(evaluations=evaluations))


def test_an_arm_of_two_joints_keeps_everything(planar, settings):
    arm = limited(planar, ["acceleration", "jerk"], 0.2)
    regions = Sphere((1.4, 0.0, 1.1), 0.2), Box((1.2, -1, 0.9), (1.6, 1, 1.2)), Plane((0, 0, 1), 0.1)
    of = Constraints(slow(arm), regions, clearance=0.01), Trajectory(2, 3, 8.0)
    assert_valid(Designer(*of, settings).ask(evaluations=10))


def test_more_evaluations_are_never_worse_and_soon_good(designer):
    few, many = (designer.ask(evaluations=n) for n in (1, 200))
    assert many.criteria.condition <= few.criteria.condition * 1.01
    assert many.criteria.condition < 400


@pytest.mark.parametrize("case", ["desk", "all"])
def test_a_number_of_evaluations_gives_the_same_answer_again(arm, designer_of, settings, case):
    """What was asked before does not matter."""
    first, again = designer_of(case), Designer(*CASES[case](arm), settings)
    again.ask(evaluations=7)
    one, other = (x.ask(evaluations=FEW).coefficients for x in (first, again))
    assert torch.equal(one, other)


def test_a_deadline_is_kept_and_what_is_proven_by_then_comes_back(arm, settings):
    designer = Designer(*CASES["box"](arm), settings, clock=ticking(1e-3))
    for deadline in (0.1, 0.3):
        design = designer.ask(deadline=deadline)
        assert design.spent.seconds <= deadline + 10 * 1e-3  # ten looks at the clock
        assert_valid(design)
    design = Designer(*CASES["box"](arm), settings, clock=ticking(1.0)).ask(deadline=1e-3)
    assert design.coefficients is None and design.blocked
    with pytest.raises(InfeasibleError, match="in time"):
        _ = design.criteria


@pytest.mark.parametrize("gap", [0.0005, 0.003])
@pytest.mark.parametrize("evaluations", [6, 12])
def test_a_home_with_hardly_any_room_is_answered(planar, settings, gap, evaluations):
    """A wall so close to home that any motion is in the reserve that is kept elsewhere."""
    home, wall = (0.3, 0.4), Plane((1.0, 0.0, 0.0), -5.0)
    rest = torch.tensor([home], dtype=torch.float64)
    apart = float(Constraints(planar, [wall]).at_rest(rest)["keep_out"].min())
    near = Constraints(planar, [replace(wall, offset=wall.offset + apart - gap)])
    design = Designer(near, Trajectory(2, 3, 8.0, home), settings).ask(evaluations=evaluations)
    assert_valid(design)
    assert design.coefficients.abs().max() > 0.1


def test_evaluations_and_proofs_are_counted(arm, settings):
    designer, evaluations = Designer(*CASES["all"](arm), settings), []
    start, designer.prover.prove = designer.descents.descent, Mock(wraps=designer.prover.prove)

    def counted(*scene):
        descent = start(*scene)
        run, evaluate = descent.run, descent.evaluate
        descent.run = lambda n: (evaluations.append(n), run(n))[1]
        descent.evaluate = lambda *point: (evaluations.append(1), evaluate(*point))[1]
        return descent

    designer.descents.descent = counted
    spent = designer.ask(evaluations=FEW).spent
    assert spent.evaluations == sum(evaluations) >= FEW
    assert spent.proofs == designer.prover.prove.call_count - 1  # home's does not count


@pytest.mark.parametrize(
    ("of", "words"),
    [
        (lambda arm: (Constraints(arm), [0, 0, 0, 2.5, 0, 0, 0]), "position of joint_4"),
        (lambda arm: (Constraints(arm, [Box((-0.2, -0.2, 0.9), (0.2, 0.2, 1.5))]), None), "keep_out"),
        (lambda arm: (Constraints(slow(arm, 1, 0.1)), [0, 1.57, 0, 0, 0, 0, 0]), "torque of joint_2"),
    ],
)
def test_what_stands_in_the_way_is_told(arm, settings, of, words):
    constraints, home = of(arm)
    design = Designer(constraints, Trajectory(7, home=home), settings).ask(evaluations=FEW)
    assert design.coefficients is None
    assert any(f"at home, {words}" in one for one in design.blocked), design.blocked


@pytest.mark.parametrize("case", ["desk", "box", "pieces", "pieces apart", *HIGHER])
def test_proofs_without_overhead_are_those_of_the_check(designer_of, case):
    """Of random trajectories of which some are valid."""
    numbers = designer_of(case).numbers
    scene, prover = scene_of(numbers), Prover(numbers)
    constraints, family = numbers.among(scene), numbers.family(scene)
    random, valid = np.random.default_rng(0), []
    for _ in range(12):
        x = random.standard_normal(scene.size.shape) * random.uniform(0.02, 0.6)
        c = numbers.within(scene, (x * scene.size) @ numbers.turn.T, random.uniform(0.5, 1.2))
        one = prover.prove(scene, c)
        other = check(constraints, family, torch.from_numpy(c).reshape(1, *family.shape))
        assert one.valid == bool(other.valid)
        valid.append(one.valid)
        if one.valid:
            expected = [float(other.margins.get(name, torch.inf)) for name in NAMES]
            np.testing.assert_allclose(one.margins, expected, atol=1e-6)
    assert any(valid) and not all(valid)


def test_each_aim_serves_its_own_criterion(designer):
    """More evaluations are better by it, wherever the search goes; and each goes its own way."""
    body, amount = designer.numbers.constraints.body, designer.settings.rate * 16.0
    c = 0.2 * torch.randn(1, 7, 6, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    prior = amount * information_of(body, Trajectory(7), c).matrices(slice(None))[0].numpy()

    def known(x):
        return np.linalg.slogdet(prior + amount * x.information.numpy())[1]

    def even(x):
        return -float(excite(body, x.trajectory, x.coefficients[None]).diagonal_fitness)

    ends = [designer.ask(evaluations=FEW).coefficients]
    for aim, value in ((Aim("determinant", prior), known), (Aim("diagonal"), even)):
        begun, ended = (designer.ask(aim=aim, evaluations=n) for n in (1, FEW))
        assert value(ended) > value(begun)
        ends.append(ended.coefficients)
    assert all(not torch.allclose(one, other) for one, other in combinations(ends, 2))


@pytest.mark.parametrize(
    ("asked", "error"),
    [
        (lambda model, other: {}, ConfigError),
        (lambda model, other: {"evaluations": 0}, ConfigError),
        (lambda model, other: {"deadline": -1.0}, ConfigError),
        (lambda model, other: {"deadline": float("nan")}, ConfigError),
        (lambda model, other: Aim("fast"), ConfigError),
        (lambda model, other: Aim(prior=np.eye(43)), ConfigError),
        (lambda model, other: Aim(model=model), ConfigError),
        (lambda model, other: Aim(interest={"x": 1.0}), ConfigError),
        (lambda model, other: Aim("determinant", tasks=np.eye(43)), ConfigError),
        (lambda model, other: Aim("variance", interest={"link_7": 1.0}, tasks=np.eye(43)), ConfigError),
        (lambda model, other: Aim("variance", interest={"elbow": 1.0}), ConfigError),
        (lambda model, other: Aim(noise=[1.0] * 6), ShapeError),
        (lambda model, other: Aim(noise=[0.0] * 7), ShapeError),
        (lambda model, other: Aim("determinant", -np.eye(43)), ShapeError),
        (lambda model, other: Aim("determinant", np.eye(3)), ShapeError),
        (lambda model, other: Aim("determinant", np.eye(42), model=model), ShapeError),
        (lambda model, other: Aim("variance", model=model, tasks=-np.eye(model.count)), ShapeError),
        (lambda model, other: Aim("variance", tasks=np.eye(42)), ShapeError),
        (lambda model, other: Aim("determinant", model=other), ShapeError),
    ],
)
def test_what_makes_no_sense_is_refused(designer, planar, asked, error):
    with pytest.raises(error):
        asked = asked(TorqueModel(designer.numbers.constraints.body), TorqueModel(RigidBody(planar)))
        designer.ask(**(asked if isinstance(asked, dict) else {"aim": asked, "evaluations": 1}))
