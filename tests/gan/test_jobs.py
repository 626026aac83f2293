import io
from dataclasses import replace

import pytest
import torch

from sidegan.gan import jobs
from tests.tiny import tiny


@pytest.fixture(scope="module")
def pretraining(constraints, family, seeds, wild, tmp_path_factory):
    """Small surrogates, with their labelled samples."""
    sizes = {"samples": 160, "epochs": 2, "width": 16, "margin_steps": 8, "feature_steps": 8}
    settings, work = replace(tiny().surrogates, **sizes), tmp_path_factory.mktemp("work")
    negatives = torch.cat([wild, wild, wild])
    made = jobs.Pretraining(constraints, family, settings, seeds, negatives, work)
    for i in range(jobs.SHARES):
        made.label(i, i, ignore)
    return made


@pytest.fixture(scope="module")
def reports(pretraining):
    """What the trainings tell, whose surrogates are left in the folder of the samples."""
    report = pretraining.train_success(pretraining.work, 0, ignore)
    report |= pretraining.train_features("spectrum", pretraining.work, 0, ignore)
    return report | pretraining.train_features("diagonal", pretraining.work, 0, ignore)


def ignore(done, total):
    pass


def test_a_share_is_made_once_and_again_when_damaged(pretraining):
    path, calls = pretraining.work / "labels-0.pt", []
    whole = path.read_bytes()
    pretraining.label(0, 0, lambda *x: calls.append(x))
    assert not calls
    path.write_bytes(whole[:100])
    pretraining.label(0, 0, lambda *x: calls.append(x))
    assert calls
    torch.testing.assert_close(torch.load(path), torch.load(io.BytesIO(whole)))


def test_seeds_are_held_out(seeds):
    training, held = jobs.training_seeds(seeds)
    torch.testing.assert_close(torch.cat([training, held]), seeds)
    assert 0.1 < len(held) / len(seeds) < 0.2
    assert [len(x) for x in jobs.training_seeds(seeds[:2])] == [1, 1]


@pytest.mark.parametrize("features", ["spectrum", "diagonal"])
def test_trained_surrogates_are_loaded_as_they_were(
    pretraining, reports, planar, family, seeds, full, features
):
    variant, c = replace(full, features=features), seeds[:5].float()
    surrogates, again = (jobs.load_surrogates(pretraining.work, variant, planar, family) for _ in range(2))
    for network, twin in ((surrogates.predictor, again.predictor), (surrogates.converter, again.converter)):
        assert not any(p.requires_grad for p in network.parameters()) and not network.training
        torch.testing.assert_close(network(c), twin(c))
        assert torch.isfinite(network(c)).all()
    assert jobs.load_surrogates(None, variant, planar, family) == jobs.Surrogates()
    r2, mean = reports[f"r2_{features}"], surrogates.converter.mean
    assert len(r2) == len(mean)
    assert reports[f"r2_{features}_mean"] == pytest.approx(sum(r2) / len(r2), rel=1e-5)
    assert all(0 <= reports[name] <= 1 for name in ("accuracy_paper", "accuracy_broad"))
