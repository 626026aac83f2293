"""The gravity of a recording is found whatever the unit of each joint's torque."""

import math
from dataclasses import replace

import pytest
import torch
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sidegan.motion.dynamics import RigidBody
from sidegan.recording.gravity import load_of
from tests.chains import random_states


@given(seed=st.integers(0, 10**6))
@settings(max_examples=20)
def test_gravity_and_scales_come_back_whatever_units_torques_have(arm, seed):
    random = torch.Generator().manual_seed(seed)
    q, v, a = random_states(arm, 400, seed)
    direction = torch.randn(3, generator=random, dtype=torch.float64)
    gravity = arm.gravity.norm() * direction / direction.norm()
    assume(gravity @ arm.gravity < 90)  # a direction of its own, and not the described one
    torque = RigidBody(replace(arm, gravity=gravity)).torque(q, v, a)
    share = torch.full_like(torque[0], 1e-3)
    share[1] = 0.3  # of a joint that is to count less
    noise = share * torque.std(0) * torch.randn(torque.shape, generator=random, dtype=torch.float64)
    units = 10 ** (4 * torch.rand(arm.joints, generator=random, dtype=torch.float64) - 2)
    found = load_of(RigidBody(arm), q, v, a, units * (torque + noise))
    angle = math.acos(min(1.0, float(found.gravity @ gravity / gravity.norm() ** 2)))
    assert angle < 3e-4 and float(found.gravity.norm()) == pytest.approx(float(gravity.norm()))
    assert ((found.scale / units - 1).abs() < share).all()
