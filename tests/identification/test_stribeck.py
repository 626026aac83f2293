"""Stribeck velocities: the one thing of a model that is not linear."""

import torch

from sidegan.identification import estimate
from sidegan.identification.stribeck import stribeck_velocities
from tests.identification.recordings import measured, model_of, multisine, parameters_of


def test_velocities_are_found(planar):
    truth = model_of(planar, (0.05, 0.2))
    terms = {n: torch.tensor([2.0, 1.0]) for n in ("viscous", "coulomb", "stribeck")}
    data = measured(truth, multisine(2, 3000), 0.05, parameters=parameters_of(truth, terms))
    found = stribeck_velocities(model_of(planar), iter([data]))
    assert found == [0.05, 0.2]
    better = estimate("weighted", model_of(planar, found), data)
    assert (better.residual_rms < estimate("weighted", model_of(planar), data).residual_rms).all()
