"""Surrogates that go on learning during a training."""

from dataclasses import replace
from types import SimpleNamespace

import torch

from sidegan.gan.labels import Labelled, label
from sidegan.gan.refresh import Refreshed
from sidegan.gan.tensors import tensor
from tests.gan.conftest import REFRESH, STEPS


def test_refreshed_surrogates_learn_what_the_generator_makes(made, full, taught):
    """Also where it makes what they have never seen."""
    model = made(full)
    with torch.no_grad():
        model.generator.scaling.spread *= 3  # most of it violates something
    predictor, converter = model.success_predictor, model.converter
    data, c = taught, model.generator.sample(400, 5)
    truth = label(data.constraints, data.trajectory, c, STEPS, lambda *_: None)
    assert truth.valid.mean() < 0.9
    truth = Labelled(*map(tensor, truth))

    def known():
        wrong = predictor.training_step([truth.c, truth.margins, truth.valid], 0)
        return float(wrong.detach()), float(converter.explained(truth.c, truth.diagonal).mean())

    before = known()
    refreshed = Refreshed(replace(REFRESH, samples=400, steps=60), 0)
    refreshed.on_train_start(SimpleNamespace(), model)
    for _ in range(3):
        refreshed.on_train_epoch_start(SimpleNamespace(), model)
    after = known()
    assert after[0] < 0.9 * before[0] and after[1] > before[1] + 0.1, (before, after)
    assert len(refreshed.window) == 2 and len(refreshed.window[0].c) == 400
    assert not any(p.requires_grad for p in (*predictor.parameters(), *converter.parameters()))
