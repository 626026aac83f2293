"""Packed information: nothing is lost, and its spectrum is that of the full regressor, weighted by noise."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.design import information as module
from sidegan.design.information import Information, information_of, pack, unpack
from sidegan.motion.dynamics import RigidBody
from tests.chains import random_chain

from .conftest import semidefinite, trajectories

seeds = st.integers(0, 2**32 - 1)


@settings(deadline=None, max_examples=40)
@given(seeds, st.integers(1, 9))
def test_packing_loses_nothing(seed, size):
    matrices = semidefinite(seed, 3, size)
    packed = pack(matrices)
    assert packed.shape == (3, size * (size + 1) // 2)
    assert torch.equal(unpack(packed, size), (matrices.tril() + matrices.tril(-1).mT))
    assert Information(packed).size == size


@settings(deadline=None, max_examples=40)
@given(seeds, st.sampled_from([3, 1_000]))
def test_matrices_sums_means_and_products(seed, at_once):
    matrices = semidefinite(seed, 7, rank=3)
    chosen, weights = torch.tensor([4, 0, 6]), semidefinite(seed + 1, 2)
    products = torch.einsum("rij,nij->nr", weights, matrices)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(module, "_AT_ONCE", at_once)
        information = Information.of(matrices)
        near = {"rtol": 1e-10, "atol": 1e-12}
        assert len(information) == 7 and information.packed.dtype == torch.float64
        torch.testing.assert_close(information.matrices(chosen), matrices[chosen], **near)
        torch.testing.assert_close(information.stacked(chosen), matrices[chosen].sum(0), **near)
        torch.testing.assert_close(information.mean, matrices.mean(0), **near)
        torch.testing.assert_close(information.products(weights), products, **near)
        torch.testing.assert_close(information.prior(), 1e-3 * matrices.mean(0), **near)
    most = float(matrices.diagonal(dim1=1, dim2=2).sum(1).max())
    assert information.largest == pytest.approx(most, rel=1e-5)


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
    y = body.regressor(*trajectory.roll_out(c, trajectory.grid(40))[1:])
    full = torch.einsum("bj,btjp,btjq->bpq", weights, y, y) / 40
    expected = torch.linalg.eigvalsh(full)[:, -body.parameters_count :]
    found = torch.linalg.eigvalsh(information.matrices(slice(None)))
    assert ((found - expected).abs() <= 1e-9 * expected + 1e-12 * expected[:, -1:]).all()


def test_information_in_parts_is_the_same(planar, monkeypatch):
    body, (trajectory, c) = RigidBody(planar), trajectories(2, 9)
    deviation = torch.linspace(0.5, 3.0, 18, dtype=torch.float64).reshape(9, 2)
    whole = [information_of(body, trajectory, c, 30, d).packed for d in (None, deviation)]
    monkeypatch.setattr(module, "_AT_ONCE", 2)
    monkeypatch.setattr(module, "_STATES_AT_ONCE", 30)
    for known, d in zip(whole, (None, deviation)):
        torch.testing.assert_close(information_of(body, trajectory, c, 30, d).packed, known)
    assert len(information_of(body, trajectory, c[:0])) == 0
