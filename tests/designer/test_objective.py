"""The compiled objective of one trajectory: finite differences and plain torch as oracles."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.design.information import information_of
from sidegan.designer import Aim, Designer
from sidegan.designer.descent import Penalties
from sidegan.designer.designer import descents_of
from sidegan.designer.plain import PlainDescents
from sidegan.designer.scene import ArmNumbers
from sidegan.identification.model import Terms, TorqueModel, states_within
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Plane
from tests.chains import random_chain

from .conftest import CASES, scene_of

pytest.importorskip("numba")

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


def assert_plain_torch_agrees(numbers, settings, x, aim):
    scene, gradients, values = scene_of(numbers), [np.zeros_like(x), np.zeros_like(x)], []
    engines = descents_of(numbers, settings), PlainDescents(numbers, settings)
    for descents, gradient in zip(engines, gradients):
        values.append(descents.descent(scene, aim, PENALTIES).evaluate(x, gradient))
    np.testing.assert_allclose(values[0], values[1], rtol=1e-8, atol=1e-8)
    scale = np.abs(gradients[1]).max()
    np.testing.assert_allclose(gradients[0], gradients[1], rtol=1e-5, atol=1e-6 * scale)


@pytest.mark.parametrize("case", [case for case in CASES if "pieces" not in case])
def test_the_gradient_is_that_of_finite_differences_and_of_plain_torch(designer_of, settings, case):
    numbers = designer_of(case).numbers
    x, every = point(numbers, seed=2), aims(numbers)
    for aim in every.values() if case == "all" else [Aim()]:
        descent = descents_of(numbers, settings).descent(scene_of(numbers), aim, PENALTIES)
        assert descent.evaluate(x, np.zeros_like(x))[1] > 0  # something is violated
        assert_gradient(descent, x)
        assert_plain_torch_agrees(numbers, settings, x, aim)


def test_an_arm_of_two_joints_and_few_parameters(planar, settings):
    regions = Plane((0, 0, 1), 0.1), Box((0.4, -1, 0), (1, 1, 1))
    numbers = ArmNumbers(Constraints(planar, regions), Trajectory(2, 3, 8.0))
    for aim in aims(numbers).values():
        assert_plain_torch_agrees(numbers, settings, point(numbers, seed=4, use=0.8), aim)


@pytest.mark.parametrize("chain", [(3, 0), (4, 2)], ids=["five parameters", "many parameters"])
def test_sliding_joints_are_no_exception(settings, chain):
    """Nor is an arm with no more parameters than the condition number looks at eigenvalues."""
    arm, regions = random_chain(*chain)[0], (Plane((0, 0, 1), -0.3), Box((0.2, -0.4, -0.5), (0.6, 0.1, 0.4)))
    assert arm.prismatic.any() and not arm.prismatic.all()
    numbers = ArmNumbers(Constraints(arm, regions), Trajectory(arm.joints, 3, 8.0))
    assert_plain_torch_agrees(numbers, settings, point(numbers, seed=6), Aim())


@pytest.mark.parametrize("kind", ["condition", "diagonal"])
def test_an_arm_at_rest_that_feels_no_torque_tells_nothing(planar, settings, kind):
    """Without gravity: its Gram matrix is zero, all of whose elements are equal."""
    numbers = ArmNumbers(Constraints(replace(planar, gravity=0 * planar.gravity)), Trajectory(2, 3, 8.0))
    scene = scene_of(numbers)
    gradient = np.ones_like(scene.size)
    descent = descents_of(numbers, settings).descent(scene, Aim(kind), PENALTIES)
    assert descent.evaluate(np.zeros_like(scene.size), gradient) == (np.inf, 0.0)
    assert not gradient.any()


@pytest.mark.parametrize("kind", ["determinant", "variance"])
def test_an_aim_with_a_model_is_what_its_own_regressor_gives(designer_of, settings, kind):
    numbers = designer_of("no torque").numbers
    scene, x = scene_of(numbers), point(numbers, seed=5, use=0.7)
    aim = aims(numbers)["determinant with friction" if kind == "determinant" else "variance of tasks"]
    descent = descents_of(numbers, settings).descent(scene, aim, Penalties(0.0, 0.0, 0.0, 0.0))
    goal, _ = descent.evaluate(x, np.zeros_like(x))
    c = torch.from_numpy((x * scene.size) @ numbers.turn.T).reshape(1, *numbers.trajectory.shape)
    family = numbers.family(scene)
    states = [s[0] for s in family.roll_out(c, family.grid(settings.samples))[1:]]
    told = information_on(aim.model, states, aim.noise)
    whole = aim.prior + settings.rate * family.period * told
    if kind == "variance":
        assert goal == pytest.approx(np.log(np.trace(aim.tasks @ np.linalg.inv(whole))), abs=1e-6)
        return
    # log det in the basis, which is orthonormal for rigid bodies
    body = numbers.constraints.body
    basis = float(torch.linalg.slogdet(body.base.subspace)[1])
    assert goal == pytest.approx(-np.linalg.slogdet(whole)[1] - 2 * basis, abs=1e-6)


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
