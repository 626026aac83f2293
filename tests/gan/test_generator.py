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


def changed(content, name, change):
    weights = {key: change(x) if key == f"scaling.{name}" else x for key, x in content["weights"].items()}
    return {**content, "weights": {key: x for key, x in weights.items() if x is not None}}


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
        (lambda c: changed(c, "mean", lambda x: None), "scaling.mean"),
        (lambda c: resized(c, activation="tanh"), "'activation'"),
        (lambda c: broken(c, trajectory={"joints": 0}), "joints and harmonics must be positive"),
        (lambda c: broken(c, format=99), "has format 99, expected 5"),
        (lambda c: broken(c, trajectory={"joints": 2, "harmonics": 4}), "size mismatch"),
        (lambda c: resized(c, width=10**7), "fewer than the sizes"),
        (lambda c: changed(c, "mean", lambda x: x * torch.nan), "mean holds a number that is not finite"),
        (lambda c: changed(c, "mean", lambda x: x[:1]), "size mismatch for scaling.mean"),
        (lambda c: changed(c, "spread", lambda x: x[:, :2]), "size mismatch for scaling.spread"),
        (lambda c: changed(c, "spread", lambda x: 0 * x), "spread is zero"),
    ],
)
def test_a_foreign_file_is_refused(generator, change, words, tmp_path):
    path = tmp_path / "g.pt"
    generator.save(path)
    torch.save(change(torch.load(path)), path)
    with pytest.raises(ArtifactError, match=words):
        TrajectoryGenerator.load(path)
