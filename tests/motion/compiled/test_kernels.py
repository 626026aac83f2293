"""Compiled kernels against the plain torch code, Pinocchio and finite differences."""

import os
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from sidegan.errors import ConfigError, ShapeError
from sidegan.motion import compiled as kernels
from sidegan.motion import plain
from sidegan.motion.backend import usable
from sidegan.motion.compiled.chain import Chain
from sidegan.motion.dynamics import RigidBody, gram, gram_of
from sidegan.motion.trajectory import Trajectory
from tests.chains import random_chain, random_states

pytest.importorskip("numba")

CHAINS = st.tuples(st.integers(1, 9), st.integers(0, 30))
SIZES = st.tuples(
    st.integers(1, 3), st.sampled_from([1, 8, 63, 65, 130])
)  # around the number of lanes, and more than a span


def body_and_states(chain, batch, count):
    arm, model = random_chain(*chain)
    states = [x.reshape(batch, count, arm.joints) for x in random_states(arm, batch * count, chain[1])]
    return RigidBody(arm), model, states


def normal(*shape):
    return torch.randn(*shape, generator=torch.Generator().manual_seed(1), dtype=torch.float64)


@settings(deadline=None, max_examples=25)
@given(CHAINS, SIZES)
def test_grams_are_those_of_the_plain_code(chain, size):
    body, _, states = body_and_states(chain, *size)
    expected = plain.gram(body, body.base.columns, states)
    torch.testing.assert_close(
        gram_of(body, *states), expected, rtol=0, atol=1e-13 * float(expected.abs().max())
    )


@settings(deadline=None, max_examples=25)
@given(CHAINS, SIZES, st.integers(1, 4))
def test_torques_and_their_slopes_are_those_of_the_plain_code(chain, size, sets):
    body, _, states = body_and_states(chain, *size)
    v, cotangent = normal(size[0], sets, 10 * body.joints), normal(size[0], sets, size[1], body.joints)
    x = [part.requires_grad_(True) for part in states]
    torques, expected = body.torques_of(*x, v), plain.torques(body, x, v)
    scale = float(expected.detach().abs().max())
    torch.testing.assert_close(torques, expected, rtol=0, atol=1e-13 * scale)
    ours, reference = (torch.autograd.grad(torque, x, cotangent) for torque in (torques, expected))
    scale = max(float(slope.abs().max()) for slope in reference)
    for one, other in zip(ours, reference):
        torch.testing.assert_close(one, other, rtol=0, atol=1e-12 * scale)


@settings(deadline=None, max_examples=15)
@given(CHAINS)
def test_torques_are_pinocchios(chain):
    body, model, states = body_and_states(chain, 2, 9)
    data = model.createData()
    flat = zip(*(x.flatten(0, 1).numpy() for x in states))
    expected = np.stack([pin.rnea(model, data, *state).copy() for state in flat])
    torque = body.torque(*states).flatten(0, 1)
    np.testing.assert_allclose(torque, expected, rtol=0, atol=1e-12 * np.abs(expected).max())


@settings(deadline=None, max_examples=15)
@given(CHAINS)
def test_energy_slopes_are_those_of_the_plain_code(chain):
    body, _, states = body_and_states(chain, 2, 5)
    v, weights = normal(2, 3, 10 * body.joints), normal(2, 3)
    slopes = body.penalised_slopes(states, v, weights)[1]
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv(kernels.VARIABLE, "torch")
        expected = body.penalised_slopes(states, v, weights)[1]
    scale = max(float(slope.abs().max()) for slope in expected)
    for one, other in zip(slopes, expected):
        torch.testing.assert_close(one, other, rtol=0, atol=1e-12 * scale)


@pytest.mark.parametrize("chain", [(3, 0), (4, 1)])
def test_slopes_agree_with_finite_differences(chain, engine):
    body, _, states = body_and_states(chain, 2, 3)
    x = tuple(part.requires_grad_(True) for part in states)
    v = normal(2, 2, 10 * body.joints)
    assert torch.autograd.gradcheck(lambda *s: body.torques_of(*s, v), x)
    assert torch.autograd.gradcheck(body.torque, x)


@pytest.mark.parametrize("joints", [2, 3])
def test_gradients_of_any_function_of_the_gram_agree_with_finite_differences(joints, engine):
    arm, _ = random_chain(joints, 3)
    body, trajectory = RigidBody(arm), Trajectory(joints, 1, 8.0)
    c = (0.3 * normal(2, *trajectory.shape)).requires_grad_(True)

    def several(x):
        grams = gram(body, trajectory, x, 12)
        return grams, grams.diagonal(dim1=1, dim2=2).square(), (grams * grams).sum()

    assert torch.autograd.gradcheck(several, c, rtol=1e-3, atol=1e-4)


def test_the_gradient_of_the_condition_number_agrees_with_the_plain_code(arm):
    body, trajectory = RigidBody(arm), Trajectory(7)
    c = 0.2 * normal(3, *trajectory.shape)
    gradients = {}
    for name in ("torch", "numba"):
        with pytest.MonkeyPatch.context() as patch:
            patch.setenv(kernels.VARIABLE, name)
            x = c.clone().requires_grad_(True)
            spectrum = torch.linalg.eigvalsh(gram(body, trajectory, x))
            (spectrum[:, -1] / spectrum[:, 0]).log().sum().backward()
            gradients[name] = x.grad
    scale = float(gradients["torch"].abs().max())
    torch.testing.assert_close(gradients["numba"], gradients["torch"], rtol=0, atol=1e-8 * scale)


def test_a_derivative_can_be_derived_again(planar, engine):
    body = RigidBody(planar)
    x = tuple(part.requires_grad_(True) for part in random_states(planar, 3))
    assert torch.autograd.gradgradcheck(body.torque, x)
    trajectory = Trajectory(2, 2, 8.0)
    c = (0.3 * normal(1, *trajectory.shape)).requires_grad_(True)
    assert torch.autograd.gradgradcheck(lambda x: gram(body, trajectory, x, 12), c, rtol=1e-3, atol=1e-4)


@pytest.mark.parametrize("rows", range(1, 10))
def test_a_product_in_tiles_of_four_reads_no_row_that_is_not_there(rows):
    """As plain Python, which refuses what compiled code would read behind the last row."""
    from sidegan.motion.compiled.regressor import tile

    y, product, ends = normal(rows, 7).numpy(), np.zeros((rows, rows)), range(0, rows, 4)
    for i in ends:
        for j in ends:
            tile.py_func(y, (i, rows), (j, rows), 1, 6, product)
    np.testing.assert_allclose(product, y[:, 1:6] @ y[:, 1:6].T, atol=1e-14)


def test_columns_may_come_in_any_order(arm):
    body, _, states = body_and_states((4, 0), 2, 9)
    order = torch.randperm(body.parameters_count, generator=torch.Generator().manual_seed(0))
    other = RigidBody(body.arm)
    other.base = replace(body.base, columns=body.base.columns[order])
    grams, whole = gram_of(other, *states), gram_of(body, *states)
    torch.testing.assert_close(grams, whole[:, order][:, :, order])


def test_results_do_not_depend_on_threads_or_batches(arm):
    body, trajectory = RigidBody(arm), Trajectory(7)
    c = 0.2 * normal(60, *trajectory.shape)
    one = gram(body, trajectory, c)
    torch.set_num_threads(2)
    try:
        two = gram(body, trajectory, c)
    finally:
        torch.set_num_threads(1)
    torch.testing.assert_close(one, two, rtol=1e-13, atol=1e-12)
    torch.testing.assert_close(gram(body, trajectory, c[7:8]), one[7:8], rtol=1e-13, atol=1e-12)


def test_other_types_take_the_plain_code(arm):
    body = RigidBody(arm)
    q = torch.zeros(2, 3, 7)
    assert not usable(q)
    assert body.torque(q, q, q).dtype == torch.float32
    assert body.torques_of(q, q, q, torch.zeros(2, 1, 70)).shape == (2, 1, 3, 7)


def test_no_state_is_no_work(arm):
    body = RigidBody(arm)
    for shape in ((0, 5, 7), (2, 0, 7)):
        q = torch.zeros(shape, dtype=torch.float64, requires_grad=True)
        body.torque(q, q, q).sum().backward()
        assert q.grad is not None and q.grad.shape == shape


def test_states_that_do_not_fit_are_refused(arm):
    q, v = torch.zeros(2, 3, 6, dtype=torch.float64), torch.zeros(2, 1, 70, dtype=torch.float64)
    for use in (
        RigidBody(arm).torques_of,
        lambda *x: RigidBody(arm).penalised_slopes(x[:3], x[3], v[:, :, 0])[1],
    ):
        with pytest.raises(ShapeError, match="expected"):
            use(q, q, q, v)


def test_the_environment_chooses(monkeypatch):
    monkeypatch.delenv(kernels.VARIABLE, raising=False)
    assert kernels.compiled()
    monkeypatch.setenv(kernels.VARIABLE, "torch")
    assert not kernels.compiled()
    monkeypatch.setenv(kernels.VARIABLE, "fortran")
    with pytest.raises(ConfigError, match="'fortran', expected torch or numba"):
        kernels.compiled()


def test_without_numba_the_plain_code_runs(monkeypatch):
    monkeypatch.setattr(kernels, "_installed", lambda: False)
    monkeypatch.delenv(kernels.VARIABLE, raising=False)
    assert not kernels.compiled()
    monkeypatch.setenv(kernels.VARIABLE, "numba")
    with pytest.raises(ConfigError, match="not installed"):
        kernels.compiled()


def test_numba_is_not_imported_before_it_is_needed():
    code = "import sys, sidegan.seeds, sidegan.motion.dynamics; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env={**os.environ}, check=False).returncode == 0


def test_chain_places_joints_as_the_arm_does(arm):
    """A joint turns about its axis, or slides along it, in the frame that it has at zero."""
    for other in (arm, random_chain(6, 4)[0]):
        q = random_states(other, 1)[0][0]
        chain = Chain.of(other)
        for i, angle in enumerate(q.tolist()):
            turn = 0.0 if other.prismatic[i] else angle
            own = Rotation.from_rotvec(turn * other.axis[i].numpy()).as_matrix()
            mixed = chain.fixed[i] + chain.sine[i] * np.sin(angle) + chain.cosine[i] * np.cos(angle)
            expected = other.rotation[i].numpy() @ own
            np.testing.assert_allclose(mixed, expected.flatten(), atol=1e-14)
            slide = other.rotation[i] @ other.axis[i] * (angle - turn)
            place = chain.origin[i] + chain.slide[i] * angle
            np.testing.assert_allclose(place, other.translation[i] + slide, atol=1e-14)
