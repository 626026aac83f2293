import torch

from sidegan.gan.pretrain import accuracy, explained, split
from sidegan.gan.surrogates import Converter
from tests.gan.conftest import random


def test_the_predictor_learns_validity(predictor, labelled):
    held = labelled[1]
    share = float(held.valid.double().mean())
    assert 0.15 < share < 0.85  # or there would be nothing to learn
    assert accuracy(predictor, held.c, held.valid) > 0.9


def test_the_converter_learns_the_features(converter, labelled):
    held = labelled[1]
    r2 = explained(converter, held.c, held.diagonal)
    assert r2.shape == (held.diagonal.shape[1],)
    assert r2.mean() > 0.8


def test_trained_surrogates_are_frozen(predictor, converter):
    for network in (predictor, converter):
        assert not network.training
        assert not any(p.requires_grad for p in network.parameters())


def test_an_untrained_converter_explains_nothing(planar, family, labelled):
    held = labelled[1]
    converter = Converter(planar, family, held.diagonal.shape[1], 8, 8)
    converter.fit_standard(held.diagonal)
    assert explained(converter, held.c, held.diagonal).mean() < 0.5


def test_nothing_is_both_learnt_from_and_held_out(labelled):
    data, held = labelled
    everything = torch.cat([data.c, held.c]).flatten(1)
    again = split(data, random())
    assert len(again[0].c) + len(again[1].c) == len(data.c)
    assert len(torch.unique(everything, dim=0)) == len(everything)
    assert 0.1 < len(held.c) / len(everything) < 0.2
