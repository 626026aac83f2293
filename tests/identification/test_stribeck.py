"""Stribeck velocities: the one thing of a model that is not linear."""

import torch

from sidegan.identification import Measurements, estimate
from sidegan.identification.stribeck import stribeck_velocities
from tests.identification.recordings import model_of, multisine, parameters_of, white


def test_velocities_are_found(planar):
    truth = model_of(planar, (0.05, 0.2))
    states = multisine(2, 3000)
    terms = {n: torch.tensor([2.0, 1.0]) for n in ("viscous", "coulomb", "stribeck")}
    torque = truth.torque(parameters_of(truth, terms), *states)
    data = Measurements(*states, torque + 0.05 * white(torque.shape, 0))
    found = stribeck_velocities(model_of(planar), iter([data]))
    assert found == [0.05, 0.2]
    better = estimate("weighted", model_of(planar, found), data)
    assert (better.residual_rms < estimate("weighted", model_of(planar), data).residual_rms).all()
