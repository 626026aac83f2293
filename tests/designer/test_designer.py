"""What a designer answers: proven by another author's physics, the same again, in time, or why not."""

from dataclasses import replace

import coal
import numpy as np
import pinocchio as pin
import pytest
import torch

from sidegan.design.excitation import excite
from sidegan.design.information import information_of
from sidegan.designer import Aim, Designer, Situation
from sidegan.errors import ConfigError, InfeasibleError, ShapeError
from sidegan.identification import TorqueModel
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot.oracle import capsule_geometry, pinocchio_model
from sidegan.validity import Box, Constraints, Plane, check

from .conftest import DESK, HOME, SITUATIONS

RATE = 1_000.0  # [Hz]
FEW = 30  # evaluations


class Clock:
    """A clock that goes on by a fixed step whenever it is read."""

    def __init__(self, step):
        self.now, self.step = 0.0, step

    def __call__(self):
        self.now += self.step
        return self.now


def region_distances(region, geometry, data, guarded):
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
        one = geometry.geometryObjects[k].geometry
        request, result = coal.DistanceRequest(), coal.DistanceResult()
        distances.append(coal.distance(one, where, shape, placement, request, result))
    return min(distances)


def assert_valid_by_pinocchio(arm, design, situation, regions):
    """Limits, torques and distances at 1 kHz, none of them by sidegan."""
    trajectory, c = design.trajectory, design.coefficients[None]
    motion = trajectory.roll_out(c, trajectory.times(RATE))
    q, dq, ddq = (x[0].numpy() for x in motion[1:])
    assert (q >= arm.position_lower.numpy()).all() and (q <= arm.position_upper.numpy()).all()
    assert (np.abs(dq) <= situation.velocity * arm.velocity_limit.numpy()).all()
    model, geometry = pinocchio_model(arm), capsule_geometry(arm)
    data = model.createData()
    for first, second in design.scene.shapes.pairs.tolist():
        geometry.addCollisionPair(pin.CollisionPair(first, second))
    shapes = geometry.createData()
    guarded = design.scene.shapes.guarded
    for k in range(len(q)):
        torque = pin.rnea(model, data, q[k], dq[k], ddq[k])
        assert (np.abs(torque) <= situation.torque * arm.torque_limit.numpy()).all()
        pin.computeDistances(model, data, geometry, shapes, q[k])
        assert min(x.min_distance for x in shapes.distanceResults) >= situation.clearance - 1e-6
        for number, region in enumerate(regions):
            own = guarded[guarded[:, 0] == number, 1].tolist()
            assert region_distances(region, geometry, shapes, own) >= situation.clearance - 1e-6


def test_every_answer_is_valid_by_pinocchio_and_coal(arm, designer, situation):
    design = designer.ask(situation, evaluations=FEW)
    assert design.coefficients is not None and not design.blocked
    assert_valid_by_pinocchio(arm, design, situation, [DESK, *situation.regions])


@pytest.mark.parametrize("evaluations", [1, 7, FEW])
def test_every_answer_is_valid_by_the_usual_check(designer, situation, evaluations):
    design = designer.ask(situation, evaluations=evaluations)
    assert design.coefficients is not None and not design.blocked
    assert bool(check(design.constraints, design.trajectory, design.coefficients[None]).valid[0])


def test_an_answer_keeps_what_the_usual_constraints_say(arm, designer, situation):
    design = designer.ask(situation, evaluations=FEW)
    constraints = Constraints(arm, [DESK, *situation.regions], clearance=situation.clearance)
    assert bool(check(constraints, design.trajectory, design.coefficients[None]).valid[0])
    assert constraints.guarded.tolist() == design.scene.shapes.guarded.tolist()


def test_margins_are_those_of_the_check(designer):
    design = designer.ask(SITUATIONS["box"], evaluations=FEW)
    found = check(design.constraints, design.trajectory, design.coefficients[None])
    for name, margin in design.margins.items():
        assert float(found.margins[name][0]) == pytest.approx(margin, abs=1e-6)


def test_more_evaluations_are_never_worse_and_soon_good(designer):
    few, many = (designer.ask(SITUATIONS["box"], evaluations=n) for n in (1, 60))
    assert many.criteria.condition <= few.criteria.condition * 1.01
    assert many.criteria.condition < 400


def test_a_number_of_evaluations_gives_the_same_answer_again(workspace, settings, starts, situation):
    answers = [
        Designer(*workspace, settings, starts).ask(situation, evaluations=FEW).coefficients for _ in range(2)
    ]
    again = Designer(*workspace, settings, starts)
    again.ask(SITUATIONS["nothing"], evaluations=7)  # what was asked before does not matter
    answers.append(again.ask(situation, evaluations=FEW).coefficients)
    assert all(torch.equal(answers[0], other) for other in answers[1:])


def test_a_deadline_is_kept_and_what_is_proven_by_then_comes_back(workspace, settings, starts):
    designer = Designer(*workspace, settings, starts, clock=Clock(1e-3))
    for deadline in (0.03, 0.1, 0.3):
        design = designer.ask(SITUATIONS["home"], deadline=deadline)
        assert design.spent.seconds <= deadline + 10 * 1e-3  # ten looks at the clock
        assert design.coefficients is not None
        assert bool(check(design.constraints, design.trajectory, design.coefficients[None]).valid[0])


def test_a_deadline_too_short_for_any_proof_is_no_answer(workspace, settings, starts):
    design = Designer(*workspace, settings, starts, clock=Clock(1.0)).ask(deadline=1e-3)
    assert design.coefficients is None and design.blocked
    with pytest.raises(InfeasibleError, match="in time"):
        _ = design.criteria


class Counted:
    """Descents whose evaluations are counted, and their proofs."""

    def __init__(self, designer):
        self.descents, self.prover, self.evaluations, self.proofs = designer.descents, designer.prover, 0, 0

    def descent(self, *scene):
        inner = self.descents.descent(*scene)
        run, evaluate = inner.run, inner.evaluate

        def counted(evaluations):
            self.evaluations += evaluations
            run(evaluations)

        def once(*point):
            self.evaluations += 1
            return evaluate(*point)

        inner.run, inner.evaluate = counted, once
        return inner

    def prove(self, *question):
        self.proofs += 1
        return self.prover.prove(*question)


@pytest.mark.parametrize("gap", [0.0005, 0.003])
@pytest.mark.parametrize("evaluations", [6, 12])
def test_a_home_with_hardly_any_room_is_answered(planar, settings, monkeypatch, gap, evaluations):
    """A wall so close to home that any motion is in the reserve that is kept elsewhere."""
    monkeypatch.setenv("SIDEGAN_KERNELS", "torch")
    home = (0.3, 0.4)
    designer = Designer(Constraints(planar, []), Trajectory(2, 3, 8.0), settings)
    wall = Plane((1.0, 0.0, 0.0), -5.0)
    far = designer.numbers.among(designer.numbers.scene(Situation(home, [wall])))
    apart = float(far.at_rest(torch.tensor([home], dtype=torch.float64))["keep_out"].min())
    near = replace(wall, offset=wall.offset + apart - gap)
    design = designer.ask(Situation(home, [near]), evaluations=evaluations)
    assert design.coefficients is not None, design.blocked
    c = design.coefficients[None]
    assert c.abs().max() > 0.1 and check(design.constraints, design.trajectory, c).valid.all()


def test_evaluations_and_proofs_are_counted(designer, situation, monkeypatch):
    counted = Counted(designer)
    monkeypatch.setattr(designer, "descents", counted)
    monkeypatch.setattr(designer, "prover", counted)
    spent = designer.ask(situation, evaluations=FEW).spent
    assert spent.evaluations == counted.evaluations >= FEW
    assert spent.proofs == counted.proofs - 1  # home's does not count


@pytest.mark.parametrize(
    ("situation", "words"),
    [
        (Situation([0.0, 0.0, 0.0, 2.5, 0.0, 0.0, 0.0]), "at home, position of joint_4"),
        (Situation(regions=[Box((-0.2, -0.2, 0.9), (0.2, 0.2, 1.5))]), "at home, keep_out"),
        (Situation(regions=[Plane((0.0, 0.0, 1.0), 3.0)]), "no link is ever outside"),
        (Situation([0.0, 1.57, 0.0, 0.0, 0.0, 0.0, 0.0], torque=0.1), "at home, torque"),
        (Situation(clearance=1.0), "at home, collision"),
    ],
)
def test_what_stands_in_the_way_is_told(designer, situation, words):
    design = designer.ask(situation, evaluations=FEW)
    assert design.coefficients is None
    assert any(words in one for one in design.blocked), design.blocked


@pytest.mark.parametrize(
    ("asked", "error"),
    [
        ({}, ConfigError),
        ({"evaluations": 0}, ConfigError),
        ({"deadline": -1.0}, ConfigError),
        ({"deadline": float("nan")}, ConfigError),
        ({"situation": Situation([0.0] * 6), "evaluations": 1}, ShapeError),
        ({"situation": Situation([float("nan")] * 7), "evaluations": 1}, ShapeError),
        ({"aim": Aim(noise=[1.0] * 6), "evaluations": 1}, ShapeError),
        ({"aim": Aim(noise=[0.0] * 7), "evaluations": 1}, ShapeError),
        ({"aim": Aim("determinant", -np.eye(43)), "evaluations": 1}, ShapeError),
        ({"aim": Aim("determinant", np.eye(3)), "evaluations": 1}, ShapeError),
        ({"aim": Aim("variance", interest={"elbow": 1.0}), "evaluations": 1}, ConfigError),
    ],
)
def test_what_makes_no_sense_is_refused(designer, asked, error):
    with pytest.raises(error):
        designer.ask(**asked)


def test_what_does_not_fit_a_model_is_refused(designer, planar):
    model = TorqueModel(designer.numbers.constraints.body)
    other = TorqueModel(RigidBody(planar))
    with pytest.raises(ConfigError, match="a model has no part in the aim 'condition'"):
        Aim(model=model)
    for aim, words in (
        (Aim("determinant", model=other), "the model is of another arm"),
        (Aim("determinant", np.eye(43), model=model), "prior is "),
        (Aim("variance", model=model, tasks=-np.eye(model.count)), "tasks is not symmetric and positive"),
        (Aim("variance", tasks=np.eye(model.count)), "tasks is "),
    ):
        with pytest.raises(ShapeError, match=words):
            designer.ask(aim=aim, evaluations=1)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Situation(velocity=0.0),
        lambda: Situation(torque=1.5),
        lambda: Situation(period=0.0),
        lambda: Situation(clearance=-0.1),
        lambda: Aim("fast"),
        lambda: Aim(prior=np.eye(43)),
        lambda: Aim(interest={"x": 1.0}),
        lambda: Aim("determinant", tasks=np.eye(43)),
        lambda: Aim("variance", interest={"link_7": 1.0}, tasks=np.eye(43)),
    ],
)
def test_impossible_requests_are_refused(make):
    with pytest.raises(ConfigError):
        make()


def test_each_aim_serves_its_own_criterion(designer, workspace):
    constraints, trajectory = workspace
    body, rate = constraints.body, designer.settings.rate
    c = 0.2 * torch.randn(1, 7, 6, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    prior = information_of(body, trajectory, c).matrices(slice(None))[0].numpy() * rate * 16.0
    plain = designer.ask(evaluations=60)
    more = designer.ask(aim=Aim("determinant", prior), evaluations=60)

    def gain(design):
        return np.linalg.slogdet(prior + rate * 16.0 * design.information.numpy())[1]

    assert gain(more) > gain(plain)
    diagonal = designer.ask(aim=Aim("diagonal"), evaluations=60)
    ratios = [excite(body, x.trajectory, x.coefficients[None]).diagonal_fitness for x in (diagonal, plain)]
    assert ratios[0] < ratios[1]


def test_without_compiled_kernels_it_answers_too(plain):
    situation = Situation(regions=[Box((1.2, -1, 0.9), (1.6, 1, 1.2))], velocity=0.8)
    first, second = (plain.ask(situation, evaluations=12) for _ in range(2))
    assert first.coefficients is not None and torch.equal(first.coefficients, second.coefficients)
    assert bool(check(first.constraints, first.trajectory, first.coefficients[None]).valid[0])


def test_both_engines_find_the_same_from_the_same_start(planar, settings, plain):
    pytest.importorskip("numba")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("SIDEGAN_KERNELS", "numba")
        compiled = Designer(Constraints(planar, [Plane((0, 0, 1), 0.1)]), Trajectory(2, 3, 8.0), settings)
        ours = compiled.ask(evaluations=10)
    theirs = plain.ask(evaluations=10)
    torch.testing.assert_close(ours.coefficients, theirs.coefficients, rtol=1e-5, atol=1e-6)


def test_home_is_kept_at_both_ends(designer):
    design = designer.ask(SITUATIONS["home"], evaluations=FEW)
    motion = design.trajectory.roll_out(design.coefficients[None], design.trajectory.times(10.0))
    np.testing.assert_allclose(motion.position[0, [0, -1]].numpy(), [HOME, HOME], atol=1e-9)
