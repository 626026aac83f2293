"""The compiled objective of one trajectory: finite differences, and what its definition gives."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.design.information import information_of
from sidegan.design.objective import smooth_condition
from sidegan.designer import Aim, Designer
from sidegan.designer.compiled import Descents
from sidegan.designer.descent import Penalties
from sidegan.designer.scene import ArmNumbers
from sidegan.identification.model import RIGID, Terms, TorqueModel, states_within
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Plane
from tests.chains import random_chain

from .conftest import CASES, scene_of

PENALTIES = Penalties(300.0, 0.1, 0.1, 0.2)
TERMS = Terms(True, True, True, True, stribeck=True, sign_width=0.3)


def point(numbers, seed, use=1.2):
    """Natural coordinates of which each joint uses a share of its limits."""
    scene = scene_of(numbers)
    x = np.random.default_rng(seed).standard_normal(scene.size.shape)
    c = (x * scene.size) @ numbers.turn.T
    return x * (use / numbers.use(scene, c))[:, None]


def information_on(model, states, noise):
    y = (model.regressor(*states) / torch.tensor(noise)[:, None]).flatten(0, 1)
    return (y.T @ y / len(states[0])).numpy()


def aims(numbers):
    """Aims of every kind, by name."""
    body = numbers.constraints.body
    model = TorqueModel(body, TERMS, np.linspace(0.2, 0.5, body.joints).tolist())
    known = information_on(model, states_within(numbers.arm, 200, seed=4), [1.0] * body.joints)
    c = np.random.default_rng(0).standard_normal((1, *numbers.trajectory.shape))
    prior = information_of(body, numbers.trajectory, torch.from_numpy(c)).matrices(slice(None))[0].numpy()
    noise = np.linspace(0.5, 2.0, body.joints).tolist()
    tasks = information_on(model, states_within(numbers.arm, 200, seed=3), noise)
    last, links = numbers.arm.link_names[-1], numbers.arm.link_names[-2:]
    return {
        "condition": Aim(),
        "condition by noise": Aim(noise=noise),
        "diagonal": Aim("diagonal"),
        "determinant": Aim("determinant", noise=noise),
        "determinant with a prior": Aim("determinant", 100 * prior),
        "variance": Aim("variance", prior),
        "variance of a link": Aim("variance", noise=noise, interest={last: 2.0}),
        "determinant of links": Aim("determinant", prior, interest=dict.fromkeys(links, 1.0)),
        "determinant of links and joints": Aim("determinant", known, noise, {last: 1.0}, model),
        "determinant with friction": Aim("determinant", known, noise, model=model),
        "variance with friction": Aim("variance", known, noise, {last: 2.0}, model),
        "variance of tasks": Aim("variance", known, noise, model=model, tasks=tasks),
    }


def assert_gradient(descent, x):
    """By central differences along three directions."""
    gradient, ignored, random = np.zeros_like(x), np.zeros_like(x), np.random.default_rng(1)
    assert np.isfinite(sum(descent.evaluate(x, gradient)))
    near = {"rel": 1e-4, "abs": 1e-4 * max(1.0, float(np.abs(gradient).max()))}
    for direction in random.standard_normal((3, *x.shape)):
        up, down = (sum(descent.evaluate(x + s * direction, ignored)) for s in (1e-6, -1e-6))
        assert (up - down) / 2e-6 == pytest.approx(float((gradient * direction).sum()), **near)


def motion_of(numbers, x, count, orders):
    """Derivatives from none on at so many time points, (count, J) each."""
    scene = scene_of(numbers)
    family = numbers.family(scene)
    c = torch.from_numpy((x * scene.size) @ numbers.turn.T).reshape(1, *family.shape)
    return [family.derivative(c, family.grid(count), order)[0] for order in range(orders)]


def goal_of(numbers, settings, x, aim):
    """The goal by its definition, from the regressor of all parameters."""
    body, joints = numbers.constraints.body, numbers.arm.joints
    model = aim.model or TorqueModel(body, RIGID)
    told = information_on(model, motion_of(numbers, x, settings.samples, 3), aim.noise or [1.0] * joints)
    if aim.kind == "diagonal":
        return float(smooth_condition(torch.from_numpy(told).diagonal().sort().values[None])[0])
    basis = np.eye(model.count)
    basis[: model.rigid, : model.rigid] = body.base.subspace.numpy()
    whole = settings.rate * scene_of(numbers).period * basis.T @ told @ basis
    if aim.kind == "condition":
        return float(smooth_condition(torch.linalg.eigvalsh(torch.from_numpy(whole))[None])[0])
    if aim.prior is not None:
        whole = whole + (aim.prior if aim.model is None else basis.T @ aim.prior @ basis)
    if aim.kind == "determinant" and aim.interest is None:
        return -np.linalg.slogdet(whole)[1]
    covariance = basis @ np.linalg.inv(whole) @ basis.T
    if aim.tasks is not None:
        return np.log(np.trace(aim.tasks @ covariance))
    links = [*(body.base.columns // 10).tolist(), *(model.extras % joints).tolist()]
    every = dict.fromkeys(numbers.arm.link_names, 1.0)
    weights = np.array([(aim.interest or every).get(numbers.arm.link_names[k], 0.0) for k in links])
    if aim.kind == "variance":  # of rigid bodies
        return np.log((weights * covariance.diagonal())[: model.rigid].sum())
    ours = weights > 0
    return np.linalg.slogdet(covariance[ours][:, ours])[1] + np.log(weights[ours]).sum()


def cost_of(numbers, settings, x):
    """The penalty by its definition."""
    arm, constraints, p = numbers.arm, numbers.among(scene_of(numbers)), PENALTIES
    orders = 2 + len(numbers.limits)
    q, *rest = motion_of(numbers, x, settings.samples * settings.refine, orders)
    middle, room = (
        (arm.position_upper + arm.position_lower) / 2,
        (arm.position_upper - arm.position_lower) / 2,
    )
    limits = [arm.velocity_limit, *map(torch.from_numpy, numbers.limits)]
    uses = [(q - middle).abs() / room, *(x.abs() / limit for x, limit in zip(rest, limits))]
    parts = [p.weight * (use + p.reserve - 1).clamp_min(0).square() for use in uses]
    if constraints.torque:
        torque = constraints.body.torque(*motion_of(numbers, x, settings.samples, 3)).abs()
        parts.append(p.weight * (torque / constraints.arm.torque_limit + p.torque - 1).clamp_min(0).square())
    margins = constraints.at_rest(q)
    distances = [margins[name] for name in ("collision", "keep_out") if name in margins]
    parts.append(p.close * (p.reach - torch.cat(distances, 1)).clamp_min(0).square())
    return sum(float(part.sum(1).mean()) for part in parts)


def assert_defined_so(numbers, settings, x, aim):
    descent = Descents(numbers, settings).descent(scene_of(numbers), aim, PENALTIES)
    goal, cost = descent.evaluate(x, np.zeros_like(x))
    assert cost == pytest.approx(cost_of(numbers, settings, x), rel=1e-8, abs=1e-8)
    assert goal == pytest.approx(goal_of(numbers, settings, x, aim), rel=1e-6, abs=1e-6)
    assert_gradient(descent, x)


@pytest.mark.parametrize("case", [case for case in CASES if "pieces" not in case])
def test_value_and_gradient_are_those_of_the_definition_and_of_finite_differences(
    designer_of, settings, case
):
    numbers = designer_of(case).numbers
    x, every = point(numbers, seed=2), aims(numbers)
    for aim in every.values() if case == "all" else [Aim()]:
        assert_defined_so(numbers, settings, x, aim)
        assert cost_of(numbers, settings, x) > 0  # something is violated


def test_an_arm_of_two_joints_and_few_parameters(planar, settings):
    regions = Plane((0, 0, 1), 0.1), Box((0.4, -1, 0), (1, 1, 1))
    numbers = ArmNumbers(Constraints(planar, regions), Trajectory(2, 3, 8.0))
    for aim in aims(numbers).values():
        assert_defined_so(numbers, settings, point(numbers, seed=4, use=0.8), aim)


@pytest.mark.parametrize("chain", [(3, 0), (4, 2)], ids=["five parameters", "many parameters"])
def test_sliding_joints_are_no_exception(settings, chain):
    """Nor is an arm with no more parameters than the condition number looks at eigenvalues."""
    arm, regions = random_chain(*chain)[0], (Plane((0, 0, 1), -0.3), Box((0.2, -0.4, -0.5), (0.6, 0.1, 0.4)))
    assert arm.prismatic.any() and not arm.prismatic.all()
    numbers = ArmNumbers(Constraints(arm, regions), Trajectory(arm.joints, 3, 8.0))
    assert_defined_so(numbers, settings, point(numbers, seed=6), Aim())


@pytest.mark.parametrize("kind", ["condition", "diagonal"])
def test_an_arm_at_rest_that_feels_no_torque_tells_nothing(planar, settings, kind):
    """Without gravity: its Gram matrix is zero, all of whose elements are equal."""
    numbers = ArmNumbers(Constraints(replace(planar, gravity=0 * planar.gravity)), Trajectory(2, 3, 8.0))
    scene = scene_of(numbers)
    gradient = np.ones_like(scene.size)
    descent = Descents(numbers, settings).descent(scene, Aim(kind), PENALTIES)
    assert descent.evaluate(np.zeros_like(scene.size), gradient) == (np.inf, 0.0)
    assert not gradient.any()


def test_the_search_tells_friction_that_rigid_bodies_alone_do_not_ask_for(arm, settings):
    """σ on tasks of the whole model: what is designed for it beats what is designed for rigid bodies.

    From several starts, since a single search may end in a worse place than its neighbour.
    """
    ratios = []
    for seed in range(12):
        designer, found = Designer(*CASES["desk"](arm), settings, seed=seed), {}
        wanted = aims(designer.numbers)["variance of tasks"]
        rigid = Aim("determinant", noise=wanted.noise)
        for name, aim in {"whole": wanted, "rigid": rigid}.items():
            design = designer.ask(aim=aim, evaluations=200)
            times = design.trajectory.times(100.0)
            states = [s[0] for s in design.trajectory.roll_out(design.coefficients[None], times)[1:]]
            told = information_on(wanted.model, states, wanted.noise) * len(states[0])
            found[name] = np.trace(wanted.tasks @ np.linalg.inv(wanted.prior + told))
        ratios.append(found["whole"] / found["rigid"])
    assert np.exp(np.log(ratios).mean()) < 0.95, ratios  # where friction has no part both are asked alike
