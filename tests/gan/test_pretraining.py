import io
from dataclasses import replace

import pytest
import torch

from sidegan.errors import ArtifactError
from sidegan.gan import pretraining
from sidegan.motion.trajectory import Trajectory
from tests.tiny import tiny


def ignore(done, total):
    pass


@pytest.fixture(scope="module")
def small(constraints, family, seeds, wild, tmp_path_factory):
    """Small surrogates, with their labelled samples."""
    sizes = {"samples": 160, "epochs": 2, "width": 16, "margin_steps": 8, "feature_steps": 8}
    settings, work = replace(tiny().surrogates, **sizes), tmp_path_factory.mktemp("work")
    negatives = torch.cat([wild, wild, wild])
    made = pretraining.Pretraining(constraints, family, settings, seeds, negatives, work)
    for i in range(pretraining.SHARES):
        made.label(i, i, ignore)
    return made


@pytest.fixture(scope="module")
def reports(small):
    """Reports of the trainings, whose surrogates are left in the folder of the samples."""
    steps = []
    report = small.train_success(small.work, 0, lambda *step: steps.append(step))
    assert steps == [(k, 4) for k in range(1, 5)]  # two epochs of 136 samples
    report |= small.train_features("spectrum", small.work, 0, ignore)
    return report | small.train_features("diagonal", small.work, 0, ignore)


def test_a_share_is_made_once_and_again_when_damaged(small):
    path, calls = small.work / "labels-0.pt", []
    whole = path.read_bytes()
    small.label(0, 0, lambda *x: calls.append(x))
    assert not calls
    path.write_bytes(whole[:100])
    small.label(0, 0, lambda *x: calls.append(x))
    assert calls
    torch.testing.assert_close(torch.load(path), torch.load(io.BytesIO(whole)))


@pytest.mark.parametrize(("kind", "features"), [("Eigen", "spectrum"), ("Diagonal", "diagonal")])
def test_trained_surrogates_are_loaded_as_they_were(
    small, reports, planar, family, seeds, full, kind, features
):
    variant, c = replace(full, variant=kind), seeds[:5].float()
    loaded, again = (pretraining.load_surrogates(small.work, variant, planar, family) for _ in range(2))
    for network, twin in zip(loaded, again):
        assert not any(p.requires_grad for p in network.parameters()) and not network.training
        torch.testing.assert_close(network(c), twin(c))
        assert torch.isfinite(network(c)).all()
    r2, mean = reports[f"r2_{features}"], loaded[1].mean
    assert len(r2) == len(mean)
    assert reports[f"r2_{features}_mean"] == pytest.approx(sum(r2) / len(r2), rel=1e-5)
    assert all(0 <= reports[name] <= 1 for name in ("accuracy_paper", "accuracy_broad"))


def test_surrogates_of_another_arm_and_missing_ones_are_refused(
    small, reports, arm, planar, family, full, tmp_path
):
    with pytest.raises(ArtifactError, match=r"success\.pt does not fit this arm"):
        pretraining.load_surrogates(small.work, full, arm, Trajectory(7, 3))
    with pytest.raises(ArtifactError, match=r"there is no file .*success\.pt"):
        pretraining.load_surrogates(tmp_path, full, planar, family)
