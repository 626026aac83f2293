import io

import pytest
import torch

from sidegan.errors import ArtifactError
from sidegan.gan import jobs
from sidegan.motion.trajectory import Trajectory

SIZES = jobs.Sizes(16, 8, 8)


@pytest.fixture(scope="module")
def shares(constraints, family, seeds, wild, tmp_path_factory):
    folder = tmp_path_factory.mktemp("shares")
    paths = [folder / f"labels-{i}.pt" for i in range(2)]
    for i, path in enumerate(paths):
        jobs.label_share(constraints, family, seeds, wild, 60, 8, "broad", path, i, ignore)
    return paths


def ignore(done, total):
    pass


def test_a_share_is_made_once_and_again_when_damaged(shares, constraints, family, seeds, wild):
    arguments = (constraints, family, seeds, wild, 60, 8, "broad", shares[0], 0)
    whole = shares[0].read_bytes()
    told = []
    jobs.label_share(*arguments, lambda *x: told.append(x))
    assert not told
    shares[0].write_bytes(whole[:100])
    jobs.label_share(*arguments, lambda *x: told.append(x))
    assert told
    before, after = torch.load(io.BytesIO(whole)), torch.load(shares[0])
    assert before.keys() == after.keys()
    assert all(before[key].equal(after[key]) for key in before)


def test_seeds_are_held_out(seeds):
    known, held = jobs.training_seeds(seeds)
    torch.testing.assert_close(torch.cat([known, held]), seeds)
    assert 0.1 < len(held) / len(seeds) < 0.2
    assert [len(x) for x in jobs.training_seeds(seeds[:2])] == [1, 1]


def test_a_trained_predictor_is_loaded_as_it_was(
    shares, constraints, planar, arm, family, seeds, wild, tmp_path
):
    report = jobs.train_success(constraints, family, seeds, wild, shares, SIZES, 2, tmp_path, 0, ignore)
    assert all(0 <= report[name] <= 1 for name in ("accuracy_paper", "accuracy_broad"))
    assert report["near_samples"] >= 0
    predictor = jobs.load_predictor(tmp_path, planar, family)
    assert not any(p.requires_grad for p in predictor.parameters()) and not predictor.training
    again = jobs.load_predictor(tmp_path, planar, family)
    c = seeds[:5].float()
    torch.testing.assert_close(predictor(c), again(c))
    with pytest.raises(ArtifactError, match="does not fit this arm"):
        jobs.load_predictor(tmp_path, arm, Trajectory(7, 3, 8.0))


@pytest.mark.parametrize("features", ["spectrum", "diagonal"])
def test_a_trained_converter_is_loaded_as_it_was(shares, planar, family, seeds, features, tmp_path):
    report = jobs.train_features(planar, family, features, shares, SIZES, 2, tmp_path, 0, ignore)
    converter = jobs.load_converter(tmp_path, features, planar, family)
    assert len(report[f"r2_{features}"]) == len(converter.mean)
    mean = sum(report[f"r2_{features}"]) / len(converter.mean)
    assert report[f"r2_{features}_mean"] == pytest.approx(mean, rel=1e-5)
    truth = torch.cat([torch.load(path)[features] for path in shares]).log()
    assert (converter.mean.double() - truth.mean(0)).abs().max() < 3 * truth.std(0).max()
    assert torch.isfinite(converter(seeds[:5].float())).all()


def test_a_missing_surrogate_is_named(planar, family, tmp_path):
    with pytest.raises(ArtifactError, match=r"there is no file .*success\.pt"):
        jobs.load_predictor(tmp_path, planar, family)
    with pytest.raises(ArtifactError, match=r"there is no file .*spectrum\.pt"):
        jobs.load_converter(tmp_path, "spectrum", planar, family)
