import math

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design import information as module
from sidegan.design.excitation import excite
from sidegan.design.information import Information, information_of, pack, unpack
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from tests.chains import random_chain

seeds = st.integers(0, 2**32 - 1)


def semidefinite(seed, count=6, size=4, rank=3):
    rows = torch.randn(count, rank, size, generator=torch.Generator().manual_seed(seed), dtype=torch.float64)
    return rows.mT @ rows


def trajectories(joints, batch=6):
    trajectory = Trajectory(joints, 4, 8.0)
    c = torch.randn(batch, *trajectory.shape, generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    return trajectory, 0.3 * c


def of_joints(body, trajectory, c, samples):
    """Y_jᵀ Y_j / T of the full regressor for each joint, (B, J, 10 J, 10 J)."""
    y = body.regressor(*trajectory.roll_out(c, trajectory.grid(samples))[1:])
    return torch.einsum("btjp,btjq->bjpq", y, y) / samples


def full_spectrum(matrices, size):
    return torch.linalg.eigvalsh(matrices)[:, -size:]


@settings(deadline=None)
@given(seeds, st.integers(1, 9))
def test_packing_loses_nothing(seed, size):
    matrices = semidefinite(seed, 3, size)
    packed = pack(matrices)
    assert packed.shape == (3, size * (size + 1) // 2)
    assert torch.equal(unpack(packed, size), (matrices.tril() + matrices.tril(-1).mT))
    assert Information(packed).size == size


@settings(deadline=None)
@given(seeds)
def test_matrices_sums_means_and_products(seed):
    matrices = semidefinite(seed, 7)
    information = Information.of(matrices)
    near = {"rtol": 1e-10, "atol": 1e-12}
    chosen = torch.tensor([4, 0, 6])
    weights = semidefinite(seed + 1, 2)
    assert len(information) == 7 and information.packed.dtype == torch.float64
    torch.testing.assert_close(information.matrices(chosen), matrices[chosen], **near)
    torch.testing.assert_close(information.stacked(chosen), matrices[chosen].sum(0), **near)
    torch.testing.assert_close(information.mean, matrices.mean(0), **near)
    products = torch.einsum("rij,nij->nr", weights, matrices)
    torch.testing.assert_close(information.products(weights), products, **near)
    assert information.largest == pytest.approx(
        float(matrices.diagonal(dim1=1, dim2=2).sum(1).max()), rel=1e-5
    )


def test_what_is_done_in_parts_does_not_depend_on_their_size(monkeypatch):
    matrices = semidefinite(0, 11)
    whole = Information.of(matrices)
    monkeypatch.setattr(module, "_AT_ONCE", 3)
    parts = Information.of(matrices)
    chosen = torch.arange(10)
    torch.testing.assert_close(parts.mean, whole.mean)
    torch.testing.assert_close(parts.stacked(chosen), whole.stacked(chosen))


def test_a_prior_is_a_share_of_the_mean():
    information = Information.of(semidefinite(0, 9))
    torch.testing.assert_close(information.prior(), 1e-3 * information.mean)


@pytest.mark.parametrize("joints", [0, 1, 3])
@pytest.mark.parametrize("noise", ["equal", "of joints", "of all"])
def test_information_has_the_spectrum_of_the_full_regressor(joints, noise, arm):
    arm = random_chain(joints, 0)[0] if joints else arm
    body, (trajectory, c) = RigidBody(arm), trajectories(arm.joints)
    generator = torch.Generator().manual_seed(0)
    own = 0.5 + 2 * torch.rand(len(c), arm.joints, generator=generator, dtype=torch.float64)
    deviation = {"equal": None, "of joints": own[0], "of all": own}[noise]
    information = information_of(body, trajectory, c, 40, deviation)
    weights = torch.ones_like(own) if deviation is None else deviation.expand_as(own) ** -2
    full = torch.einsum("bj,bjpq->bpq", weights, of_joints(body, trajectory, c, 40))
    expected = full_spectrum(full, body.parameters_count)
    found = torch.linalg.eigvalsh(information.matrices(torch.arange(len(c))))
    assert ((found - expected).abs() <= 1e-9 * expected + 1e-12 * expected[:, -1:]).all()


def test_information_is_what_excitation_says(arm):
    body, (trajectory, c) = RigidBody(arm), trajectories(7)
    information = information_of(body, trajectory, c)
    found = torch.linalg.eigvalsh(information.matrices(slice(None)))
    torch.testing.assert_close(found, excite(body, trajectory, c).spectrum)


def test_equal_deviations_only_scale(arm):
    body, (trajectory, c) = RigidBody(arm), trajectories(7)
    plain = information_of(body, trajectory, c, 40)
    scaled = information_of(body, trajectory, c, 40, torch.full((7,), 0.5, dtype=torch.float64))
    torch.testing.assert_close(scaled.packed, 4 * plain.packed, rtol=1e-9, atol=1e-9)


def test_information_in_parts_is_the_same(planar, monkeypatch):
    body, (trajectory, c) = RigidBody(planar), trajectories(2, 9)
    deviation = torch.linspace(0.5, 3.0, 18, dtype=torch.float64).reshape(9, 2)
    whole = [information_of(body, trajectory, c, 30, d).packed for d in (None, deviation)]
    monkeypatch.setattr(module, "_AT_ONCE", 2)
    monkeypatch.setattr(module, "_STATES_AT_ONCE", 30)
    for known, d in zip(whole, (None, deviation)):
        torch.testing.assert_close(information_of(body, trajectory, c, 30, d).packed, known)


def test_information_of_none_is_empty(planar):
    trajectory, c = trajectories(2)
    assert len(information_of(RigidBody(planar), trajectory, c[:0])) == 0


@pytest.mark.parametrize("shape", [(3, 3), (2, 3, 4), (2, 0, 0)])
def test_matrices_of_a_wrong_shape_are_refused(shape):
    with pytest.raises(ShapeError, match=r"expected \(N, q, q\)"):
        Information.of(torch.ones(shape))


@pytest.mark.parametrize(
    "packed", [torch.ones(3), torch.ones(3, 5), torch.ones(3, 0), torch.ones(2, 3).int()]
)
def test_packed_numbers_of_a_wrong_shape_are_refused(packed):
    with pytest.raises(ShapeError, match="q \\+ 1"):
        Information(packed)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_what_is_not_finite_is_refused(value):
    matrices = torch.diag_embed(torch.rand(5, 4, dtype=torch.float64))
    matrices[2, 1, 1] = value
    with pytest.raises(ShapeError, match="information of trajectory 2 is not finite"):
        Information.of(matrices)


@pytest.mark.parametrize("indices", [[], [6], [-1], [0.5], [True], [[1]]])
def test_indices_that_cannot_be_are_refused(indices):
    with pytest.raises(ShapeError, match="indices are"):
        Information.of(semidefinite(0)).stacked(torch.tensor(indices))


def test_a_prior_that_cannot_be_is_refused():
    with pytest.raises(ShapeError, match="no trajectories"):
        Information(torch.ones(0, 6)).prior()
    flat = Information.of(semidefinite(0, count=1))
    with pytest.raises(ShapeError, match="no trajectory excites some direction"):
        flat.prior()


@pytest.mark.parametrize("value", [0.0, -2.0, math.nan, math.inf])
def test_deviations_that_cannot_be_are_refused(planar, value):
    trajectory, c = trajectories(2)
    with pytest.raises(ShapeError, match="finite and positive"):
        information_of(RigidBody(planar), trajectory, c, deviation=torch.tensor([1.0, value]))


@pytest.mark.parametrize("shape", [(), (1,), (3,), (5, 2), (6, 1)])
def test_deviations_of_a_wrong_shape_are_refused(planar, shape):
    trajectory, c = trajectories(2)
    with pytest.raises(ShapeError, match=r"expected \(2,\) or \(6, 2\)"):
        information_of(RigidBody(planar), trajectory, c, deviation=torch.ones(shape))


def test_coefficients_that_cannot_be_are_refused(planar):
    trajectory, c = trajectories(2)
    with pytest.raises(ShapeError, match="coefficients are"):
        information_of(RigidBody(planar), trajectory, c[0])
    c[4, 0, 0, 0] = math.nan
    with pytest.raises(ShapeError, match="trajectory 4"):
        information_of(RigidBody(planar), trajectory, c)
