"""The published recipe: networks by the authors' weights, losses by closed forms, small trainings."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.base.typed import changed
from sidegan.errors import ArtifactError
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.published import (
    IMAGE,
    ConvolutionalDiscriminator,
    ConvolutionalGenerator,
    PublishedConverter,
    PublishedPredictor,
    PublishedPretraining,
    read_weights,
)
from sidegan.gan.side_gan import Data
from sidegan.gan.surrogates import scores
from sidegan.gan.tensors import read_tensors
from sidegan.gan.variants import PublishedEigen, unevenness
from sidegan.motion.trajectory import Trajectory
from sidegan.seeding.published import WEIGHTS, Layout, PublishedSeeds
from sidegan.validity import Constraints, check
from tests.gan.conftest import with_surrogates
from tests.golden.make import DATA
from tests.refusals import refused
from tests.tiny import tiny

FAMILY = Trajectory(7, 6, 2 * math.pi / 0.4)
AUTHORS = DATA / "sidegan_authors"
SMALL = {"steps": 3, "epochs": 2, "fitness_start": 1, "generator": {"width": 4, "noise": 8, "batch": 10}}


@pytest.fixture(scope="module")
def variants():
    """The published variants, small."""
    cfg = tiny("condition=published", "seeds.folder=none")
    return {name: changed(variant, SMALL) for name, variant in cfg.gan.items()}


@pytest.fixture(scope="module")
def papers(arm):
    """The arm and 60 trajectories of which some are valid and some are not."""
    noise = np.random.default_rng(0)
    c = 0.2 * noise.random((60, 1, 1, 1)) * noise.uniform(-1, 1, (60, *FAMILY.shape))
    return Data(Constraints(arm, torque=False), FAMILY, c)


@pytest.fixture(scope="module")
def vanilla(trained, papers, variants, tmp_path_factory):
    return trained(variants["vanilla"], tmp_path_factory.mktemp("vanilla"), data=papers, samples=25)


@pytest.fixture(scope="module")
def pretraining(papers, vanilla):
    made = Layout(7, 6).coefficients(vanilla.samples.astype(float))
    valid = check(papers.constraints, FAMILY, made).valid
    return PublishedPretraining(20, Layout(7, 6).image(papers.seeds), vanilla.samples, valid)


@pytest.fixture(scope="module")
def surrogates(pretraining, tmp_path_factory):
    """Folder of surrogates that learnt from the vanilla GAN's samples, and their report."""
    made = tmp_path_factory.mktemp("surrogates")
    report = pretraining.train_success(made, 0, None, lambda *_: None)
    features = np.random.default_rng(0).uniform(1, 2, (60, 5))
    return made, report | pretraining.train_features("spectrum", features, made, 0, lambda *_: None)


def test_given_weights_are_kept_and_evaluated(pretraining, tmp_path):
    weights = PublishedPredictor().state_dict()
    report = pretraining.train_success(tmp_path, 0, weights, lambda *_: None)
    kept = read_tensors(tmp_path / "success.pt")["weights"]
    assert all(torch.equal(kept[name], x) for name, x in weights.items())
    assert 0 <= report["accuracy_paper"] <= 1


def test_a_variant_trains_on_its_surrogates_and_reloads(trained, papers, variants, surrogates, tmp_path, arm):
    report, variant = surrogates[1], variants["eigen"]
    assert 0 <= report["accuracy_broad"] <= 1 and report["error_spectrum"] < 1
    data = with_surrogates(papers, surrogates, variant)
    generator = trained(variant, tmp_path / "work", data=data).generator
    generator.save(tmp_path / "generator.pt")
    again, c = TrajectoryGenerator.load(tmp_path / "generator.pt", arm), generator.sample(23, 5)
    assert np.array_equal(again.sample(23, 5), c) and c.shape == (23, *FAMILY.shape)
    assert np.abs(c).max() < 1 / 4.9


def test_batches_are_normalised_independently_and_each_epoch_is_sampled(vanilla):
    assert vanilla.samples.shape == (2 * 25, *IMAGE) and not np.array_equal(*np.split(vanilla.samples, 2))
    network, z = ConvolutionalGenerator(8, 4, 10), torch.rand(10, 8)
    images = network(z)
    assert images.shape == (10, *IMAGE) and torch.equal(network.eval()(z), images)
    assert not torch.allclose(network(z)[:5], network(z[:5]))


def test_lists_are_convolved_as_images_one_pixel_wide():
    torch.manual_seed(0)
    network = ConvolutionalDiscriminator((11,), 4)
    lists = torch.rand(6, 11)
    images = network.layers[0](lists)
    for layer in network.layers[1:]:
        images = (
            torch.nn.Conv2d.forward(layer, images) if isinstance(layer, torch.nn.Conv2d) else layer(images)
        )
    torch.testing.assert_close(network(lists), images)


def test_published_losses_equal_their_closed_forms():
    even, peaked = torch.ones(3, 8), torch.eye(8)[:2]
    assert float(unevenness(5 * even, "entropy")) == pytest.approx(math.log(8), rel=1e-6)
    assert float(unevenness(even, "minus_entropy")) == pytest.approx(-math.log(8), rel=1e-6)
    assert float(unevenness(peaked, "entropy")) == pytest.approx(0, abs=1e-6)
    assert float(unevenness(torch.tensor([[1.0, 4.0], [2.0, 6.0]]), "ratio")) == pytest.approx(3.5)


def test_the_success_weight_grows_after_fitness_start(papers, variants, monkeypatch):
    data = replace(papers, success_predictor=PublishedPredictor(), converter=PublishedConverter(5))
    model = PublishedEigen(replace(variants["eigen"], fitness_start=10, epochs=50), data)
    weights = []
    for epoch in (0, 10, 20):
        monkeypatch.setattr(PublishedEigen, "current_epoch", epoch)
        weights.append([loss.weight for loss in model.losses()])
    assert weights == [pytest.approx(x) for x in ([0.5, 1, 0.5, 0], [0.5, 1, 0.5, 2], [0.5, 1.6, 0.5, 2])]


OTHER_SHAPE = PublishedConverter(5).state_dict() | {"fc2.weight": torch.ones(5, 3)}


@pytest.mark.parametrize("content", [[1], {"a": torch.ones(2)}, {"fc2.bias": torch.ones(2)}, OTHER_SHAPE])
def test_weights_of_another_network_are_refused(content, tmp_path):
    path = tmp_path / "weights.pth"
    torch.save(content, path)
    with refused(ArtifactError, str(path)):
        read_weights(path)


@pytest.mark.skipif(not AUTHORS.exists(), reason="the authors' weights are not at hand")
@pytest.mark.parametrize(
    ("name", "network"), [("predictor", PublishedPredictor()), ("converter", PublishedConverter(35))]
)
def test_the_authors_weights_fit_the_networks(name, network):
    weights = read_weights(AUTHORS / WEIGHTS[name])
    own = {key: x.shape for key, x in network.state_dict().items()}
    assert {key: x.shape for key, x in weights.items()} == own and (weights["scale"] == 1).all()


@pytest.mark.skipif(not AUTHORS.exists(), reason="the authors' weights are not at hand")
def test_the_authors_predictor_accepts_their_motions_only_if_they_are_small():
    shipped, predictor = PublishedSeeds(AUTHORS), PublishedPredictor()
    predictor.load_state_dict(read_weights(shipped.weights("predictor")))
    images = Layout(7, 6).image(shipped.read(FAMILY))
    told = scores(predictor.accepts, images, images[:1], images[:1], np.array([True]))
    assert told["accepted"] < 0.01 and told["accepted_25"] == 1
    assert told["accepted"] < told["accepted_75"] < told["accepted_50"] < told["accepted_25"]
