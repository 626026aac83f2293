import json

import pytest
import torch

from sidegan.errors import ArtifactError
from sidegan.gan import TrajectoryGenerator
from tests.gan.conftest import untrained


@pytest.fixture(scope="module")
def generator(planar, family, seeds):
    return untrained(planar, family, seeds)


def test_a_saved_generator_gives_identical_samples(generator, planar, tmp_path):
    generator.save(tmp_path / "generator.pt")
    loaded = TrajectoryGenerator.load(tmp_path / "generator.pt", planar)
    torch.testing.assert_close(loaded.sample(20, 5), generator.sample(20, 5), rtol=0, atol=0)
    assert loaded.trajectory == generator.trajectory


def test_samples_follow_their_seed(generator):
    a = generator.sample(6, 1)
    assert a.shape == (6, 2, 3, 2) and a.dtype == torch.float64
    torch.testing.assert_close(a, generator.sample(6, 1), rtol=0, atol=0)
    assert (a != generator.sample(6, 2)).any()
    stream = torch.Generator().manual_seed(1)
    torch.testing.assert_close(generator.sample(6, stream), a, rtol=0, atol=0)
    assert (generator.sample(6, stream) != a).any()  # a stream goes on


def broken(content, **meta):
    return {**content, "meta": json.dumps({**json.loads(content["meta"]), **meta})}


def resized(content, **sizes):
    return broken(content, network={**json.loads(content["meta"])["network"], **sizes})


FOREIGN = "does not hold a trajectory generator"


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda c: torch.zeros(3), FOREIGN),
        (lambda c: [1, 2], FOREIGN),
        (lambda c: {}, FOREIGN),
        (lambda c: {**c, "meta": "{"}, FOREIGN),
        (lambda c: {**c, "meta": "[]"}, FOREIGN),
        (lambda c: {**c, "weights": {}}, FOREIGN),
        (lambda c: {**c, "weights": 3}, FOREIGN),
        (lambda c: {k: v for k, v in c.items() if k != "mean"}, FOREIGN),
        (lambda c: resized(c, activation="tanh"), "'activation'"),
        (lambda c: broken(c, trajectory={"joints": 0}), "joints and harmonics must be positive"),
        (lambda c: broken(c, format=99), "has format 99, expected 4"),
        (lambda c: broken(c, trajectory={"joints": 2, "harmonics": 4}), "makes images"),
        (lambda c: resized(c, width=10**7), "fewer than the sizes"),
        (lambda c: {**c, "weights": {k: x * torch.nan for k, x in c["weights"].items()}}, "not finite"),
        (lambda c: {**c, "mean": c["mean"] * torch.inf}, "mean holds a number that is not finite"),
        (lambda c: {**c, "mean": c["mean"][:1]}, "mean .* expected"),
        (lambda c: {**c, "spread": c["spread"][:, :2]}, "spread .* expected"),
        (lambda c: {**c, "spread": 0 * c["spread"]}, "spread is zero"),
    ],
)
def test_a_foreign_file_is_refused(generator, change, words, tmp_path):
    path = tmp_path / "g.pt"
    generator.save(path)
    torch.save(change(torch.load(path)), path)
    with pytest.raises(ArtifactError, match=words):
        TrajectoryGenerator.load(path)
