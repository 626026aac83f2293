"""Generators in files, by seeds, and as the Gaussian from which they start."""

import math

import numpy as np
import pandas as pd
import pytest
import torch

from sidegan.errors import ArtifactError, ConfigError, ShapeError
from sidegan.gan.generator import TrajectoryGenerator
from sidegan.gan.networks import DenseGenerator
from sidegan.robot import load_robot
from tests.gan.conftest import random, untrained
from tests.refusals import refused
from tests.validity.critical import limited


@pytest.fixture(scope="module")
def generator(planar, family, seeds):
    return untrained(planar, family, seeds)


@pytest.mark.parametrize("corrections", [0, 2])
@pytest.mark.parametrize("box", [None, 0.3])
@pytest.mark.parametrize("names", [None, [], ["acceleration", "jerk"]])
def test_a_saved_generator_gives_identical_samples(family, seeds, names, box, corrections, tmp_path):
    arm = limited(load_robot("planar2"), names or [], 0.1)
    generator = untrained(arm, family, seeds, names is not None, box, corrections)
    plain = generator.sample(20, 5)
    for correction in generator.corrections:
        torch.nn.init.normal_(correction.layers[-1].weight, std=0.1)
    assert np.array_equal(generator.sample(20, 5), plain) == (not corrections)
    generator.save(tmp_path / "generator.pt")
    for given in (arm, None):  # the limits are in the file
        loaded = TrajectoryGenerator.load(tmp_path / "generator.pt", given)
        assert np.array_equal(loaded.sample(20, 5), generator.sample(20, 5))
        assert loaded.trajectory == generator.trajectory


def test_samples_follow_their_seed(generator):
    a = generator.sample(6, 1)
    assert a.shape == (6, 2, 3, 2) and a.dtype == float
    assert np.array_equal(a, generator.sample(6, 1)) and (a != generator.sample(6, 2)).any()
    stream = torch.Generator().manual_seed(1)
    assert np.array_equal(generator.sample(6, stream), a)
    assert (generator.sample(6, stream) != a).any()  # a stream goes on


FOREIGN = [
    ("format 9", lambda c: torch.zeros(3)),
    ("format 9", lambda c: [1, 2]),
    ("format 9", lambda c: c | {"format": 8}),
    ("'digest'", lambda c: {"format": 9}),
    ("state_dict", lambda c: c | {"weights": {}}),
    ("'sides'", lambda c: c | {"network": {"sides": 4}}),
    ("weights", lambda c: c | {"weights": {k: x / 0 for k, x in c["weights"].items()}}),
]


@pytest.mark.parametrize(("about", "change"), FOREIGN)
def test_a_foreign_file_is_refused(generator, planar, about, change, tmp_path):
    path = tmp_path / "g.pt"
    generator.save(path)
    torch.save(change(torch.load(path)), path)
    with refused(ArtifactError, "g.pt", about):
        TrajectoryGenerator.load(path, planar)


def test_a_file_of_another_arm_and_impossible_counts_are_refused(generator, arm, tmp_path):
    generator.save(tmp_path / "g.pt")
    with refused(ArtifactError, "g.pt", "planar2", "kuka_lwr4"):
        TrajectoryGenerator.load(tmp_path / "g.pt", arm)
    for count in (0, 1.5, True):
        with refused(ShapeError, str(count)):
            generator.sample(count)
    for seed in (1.5, -1, "one"):
        with refused(ConfigError, "seed", str(seed)):
            generator.sample(2, seed)


def test_mlflow_asks_for_one_row_of_count_and_seed(generator):
    expected = generator.sample(3, np.int64(2**32 + 1))
    for wanted in ({"count": 3, "seed": 2**32 + 1}, pd.DataFrame({"count": [3], "seed": [2**32 + 1]})):
        assert np.array_equal(generator.predict(wanted), expected)
    assert np.array_equal(generator.predict({"count": 3}), generator.sample(3, 0))
    for wanted in ({"seed": 1}, pd.DataFrame({"count": [3, 4]})):
        with refused(ShapeError, "count"):
            generator.predict(wanted)


def test_a_file_with_a_wrong_bit_is_refused_unless_it_changes_nothing(generator, planar, tmp_path):
    path = tmp_path / "g.pt"
    generator.save(path)
    whole, made, damaged = path.read_bytes(), generator.sample(5), 0
    for byte in range(0, len(whole), len(whole) // 200):
        path.write_bytes(bytes([*whole[:byte], whole[byte] ^ 0x40, *whole[byte + 1 :]]))
        try:
            assert np.array_equal(TrajectoryGenerator.load(path, planar).sample(5), made), byte
        except ArtifactError:
            damaged += 1
    assert damaged > 100


def images_of(count, shape, rank=None):
    source, size = random(3), math.prod(shape)
    mixing = torch.randn(size, rank or size, generator=source, dtype=torch.float64)
    x = torch.randn(count, rank or size, generator=source, dtype=torch.float64)
    return (x @ mixing.T + torch.linspace(-2, 2, size)).view(count, *shape)


@pytest.mark.parametrize(("noise", "rank"), [(30, None), (4, 4)])
def test_a_gaussian_start_has_mean_and_covariance_of_the_images(noise, rank):
    torch.manual_seed(0)
    images = images_of(400, (2, 2, 3), rank)
    network = DenseGenerator(2, 3, noise, width=32, shortcut=True)
    network.start_from(images)
    with torch.no_grad():
        z = network.draw(100_000)
        linear, layers = network.shortcut(z).double(), network.layers(z).flatten(1)
        torch.testing.assert_close(network(z).flatten(1), network.shortcut(z) + layers)
    x = images.flatten(1)
    torch.testing.assert_close((linear + layers).mean(0), x.mean(0), rtol=0, atol=0.05)
    expected = torch.cov(x.T)
    assert (torch.cov(linear.T) - expected).norm() < 0.02 * expected.norm()
    assert 0 < layers.std(0).mean() < 0.2  # the layers are there, but whisper
