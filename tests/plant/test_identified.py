"""What the plant executes is identified through the door of recordings: its settings come back."""

import numpy as np
import pytest
import torch

from sidegan.design.problem import Problem
from sidegan.identification import Measurements, TorqueModel, estimate, score
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.plant import Plant
from sidegan.recording.recording import Recording
from sidegan.recording.segments import preprocess
from sidegan.validity import Constraints
from tests.recording.conftest import of_file

FAMILY = Trajectory(7, 6, 16.0)


@pytest.fixture(scope="module")
def executions(arm, standard):
    """Measurements of each of eight executions."""
    start = torch.Generator().manual_seed(0)
    c = Problem(Constraints(arm, []), FAMILY).start(8, start, reach=0.8)
    plant, found = Plant(arm, standard), []
    for one, seed in zip(c, np.random.SeedSequence(0).spawn(len(c))):
        executed = plant.execute(FAMILY.roll_out(one[None], FAMILY.times(standard.rate)), seed)
        recording = Recording("plant", arm.joint_names, *executed[:3], torque=executed.torque)
        segments = preprocess(recording, of_file(bandwidth=6 / 16))
        found.append([Measurements(*segment[1:]) for segment in segments])
    return found


def test_friction_rotors_and_bias_come_back(arm, standard, executions):
    model = TorqueModel(RigidBody(arm))
    found = estimate("weighted", model, [part for parts in executions[:6] for part in parts])
    values = dict(zip(model.names, found.parameters.tolist()))
    for name, setting, error in (("fv", "viscous", 0.2), ("fc", "coulomb", 0.1), ("fo", "torque_bias", 0.05)):
        for j, wanted in enumerate(standard.of(setting, 7).tolist()):
            assert values[f"{name}{j + 1}"] == pytest.approx(wanted, abs=error), f"{name}{j + 1}"
    rotors = [value for name, value in values.items() if name.startswith("Ia")]
    assert rotors == pytest.approx([standard.rotor_inertia[0]] * len(rotors), abs=0.03)
    tests = [part for parts in executions[6:] for part in parts]
    assert score(model, found.parameters, tests).nmse_mean < 0.02
