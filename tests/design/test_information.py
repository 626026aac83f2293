"""Information has the spectrum of the full regressor, weighted by noise."""

import pytest
import torch

from sidegan.design import information as module
from sidegan.design.information import information_of
from sidegan.motion.dynamics import RigidBody
from tests.chains import random_chain

from .conftest import trajectories


@pytest.mark.parametrize("joints", [0, 1, 3])
@pytest.mark.parametrize("equal", [True, False])
def test_information_has_the_spectrum_of_the_full_regressor(joints, equal, arm):
    arm = random_chain(joints, 0)[0] if joints else arm
    body, (trajectory, c) = RigidBody(arm), trajectories(arm.joints)
    noise = torch.linspace(0.5, 2.5, arm.joints, dtype=torch.float64)
    information = information_of(body, trajectory, c, 40, None if equal else noise.tolist())
    weights = torch.ones_like(noise) if equal else noise**-2
    y = body.regressor(*trajectory.roll_out(c, trajectory.grid(40))[1:])
    full = torch.einsum("j,btjp,btjq->bpq", weights, y, y) / 40
    expected = torch.linalg.eigvalsh(full)[:, -body.parameters_count :]
    found = torch.linalg.eigvalsh(information)
    assert ((found - expected).abs() <= 1e-9 * expected + 1e-12 * expected[:, -1:]).all()


def test_weighted_information_in_parts_is_the_same(planar, monkeypatch):
    body, (trajectory, c) = RigidBody(planar), trajectories(2, 9)
    whole = information_of(body, trajectory, c, 30, [0.5, 3.0])
    monkeypatch.setattr(module, "_STATES_AT_ONCE", 60)
    torch.testing.assert_close(information_of(body, trajectory, c, 30, [0.5, 3.0]), whole)
    assert len(information_of(body, trajectory, c[:0])) == 0
