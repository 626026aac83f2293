"""The gravity of a recording is found whatever the unit of each joint's torque."""

import math
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st

from sidegan.motion.dynamics import RigidBody
from sidegan.recording.gravity import load_of
from tests.chains import random_states


@given(seed=st.integers(0, 10**6))
@settings(max_examples=20)
def test_gravity_and_torque_scales_are_recovered_in_any_unit(arm, seed):
    random = np.random.default_rng(seed)
    q, v, a = random_states(arm, 400, seed)
    direction = random.standard_normal(3)
    gravity = np.linalg.norm(arm.gravity) * direction / np.linalg.norm(direction)
    assume(gravity @ arm.gravity < 90)  # a direction of its own, and not the described one
    torque = RigidBody(replace(arm, gravity=gravity)).torque(q, v, a)
    share = np.full_like(torque[0], 1e-3)
    share[1] = 0.3  # of a joint that is to count less
    noise = share * torque.std(0) * random.standard_normal(torque.shape)
    units = 10 ** (4 * random.random(arm.joints) - 2)
    found = load_of(RigidBody(arm), q, v, a, units * (torque + noise))
    angle = math.acos(min(1.0, float(found.gravity @ gravity / np.linalg.norm(gravity) ** 2)))
    assert angle < 3e-4 and np.linalg.norm(found.gravity) == pytest.approx(np.linalg.norm(gravity))
    assert (np.abs(found.scale / units - 1) < share).all()
