import pytest
import torch
from torch import nn

from sidegan.gan.labels import label
from sidegan.gan.pretrain import accuracy, explained, train_classifier, train_converter
from sidegan.gan.shallow import Shallow, ShallowConverter, ShallowPredictor
from tests.gan.conftest import STEPS, random


@pytest.fixture(scope="module")
def told(constraints, family, seeds, wild):
    """Seeds and faulty trajectories, as the paper's surrogates see them."""
    return label(constraints, family, torch.cat([seeds, wild]), STEPS)


def test_a_shallow_network_has_four_layers_and_sees_images_in_unit_range(seeds):
    network = Shallow(*seeds.shape[1:3], 16, 3)
    network.fit_scale(seeds)
    assert (seeds / network.scale).abs().amax(0).flatten().tolist() == pytest.approx([1] * seeds[0].numel())
    assert sum(isinstance(one, (nn.Conv2d, nn.Linear)) for one in network.layers) == 4
    assert network(seeds.float()).shape == (len(seeds), 3)
    doubled = Shallow(*seeds.shape[1:3], 16, 3)
    doubled.fit_scale(2 * seeds)
    doubled.layers = network.layers
    torch.testing.assert_close(doubled(2 * seeds.float()), network(seeds.float()))


def test_the_classifier_learns_from_labels_alone(told, seeds):
    torch.manual_seed(0)
    predictor = ShallowPredictor(*seeds.shape[1:3], 32)
    predictor.layers.fit_scale(seeds)
    train_classifier(predictor, told, 60, random())
    assert accuracy(predictor, told.c, told.valid) > 0.9
    with torch.no_grad():
        torch.testing.assert_close(predictor(told.c).exp(), predictor.logits(told.c).sigmoid())


def test_rare_labels_weigh_as_much_as_frequent_ones(told, seeds):
    faulty = (~told.valid).nonzero()[:, 0]
    few = told.part(torch.cat([faulty, told.valid.nonzero()[:5, 0]]))
    torch.manual_seed(0)
    predictor = ShallowPredictor(*seeds.shape[1:3], 8)
    with torch.no_grad():
        predictor.layers.layers[-1].weight.zero_()  # all it can say is how many are valid
    predictor.layers.layers[:-1].requires_grad_(False)
    train_classifier(predictor, few, 30, random())
    assert float(predictor(few.c).exp().mean()) == pytest.approx(0.5, abs=0.15)


def test_the_converter_learns_the_features_themselves(told, seeds):
    torch.manual_seed(0)
    converter = ShallowConverter(*seeds.shape[1:3], told.diagonal.shape[1], 32)
    converter.layers.fit_scale(seeds)
    train_converter(converter, told.c, told.diagonal, 250, random())
    assert explained(converter, told.c, told.diagonal).mean() > 0.7
    standard = converter.standardise(told.diagonal)
    torch.testing.assert_close(
        standard, ((told.diagonal - told.diagonal.mean(0)) / told.diagonal.std(0)).float()
    )
    torch.testing.assert_close(
        converter.log_features(standard), told.diagonal.log().float(), rtol=1e-3, atol=1e-3
    )


def test_a_feature_that_is_predicted_negative_counts_as_the_smallest_seen(told, seeds):
    converter = ShallowConverter(*seeds.shape[1:3], told.diagonal.shape[1], 8)
    converter.fit_standard(told.diagonal)
    far = torch.full((1, told.diagonal.shape[1]), -1e3)
    smallest = told.diagonal.min().log().float()
    torch.testing.assert_close(converter.log_features(far), smallest.expand(1, told.diagonal.shape[1]))
