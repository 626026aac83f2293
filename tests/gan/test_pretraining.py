from dataclasses import replace

import pytest
import torch

from sidegan.errors import ArtifactError
from sidegan.gan import pretraining
from sidegan.gan.labels import Labelled
from sidegan.motion.trajectory import Trajectory
from tests.tiny import tiny


def ignore(done, total):
    pass


@pytest.fixture(scope="module")
def trained(constraints, family, seeds, wild, tmp_path_factory):
    """Folder of small surrogates, and the reports of their trainings."""
    sizes = {"samples": 160, "epochs": 2, "width": 16, "margin_steps": 8, "feature_steps": 8}
    settings, folder, steps = replace(tiny().surrogates, **sizes), tmp_path_factory.mktemp("surrogates"), []
    negatives = torch.cat([wild, wild, wild])
    made = pretraining.Pretraining(constraints, family, settings, seeds, negatives)
    labelled = Labelled.join(made.label(k, ignore) for k in range(pretraining.SHARES))
    report = made.train_success(labelled, folder, 0, lambda *step: steps.append(step))
    assert steps == [(4, 4)]  # two epochs of 136 samples
    for name in ("spectrum", "diagonal"):
        report |= made.train_features(name, labelled, folder, 0, ignore)
    return folder, report


@pytest.mark.parametrize(("kind", "features"), [("Eigen", "spectrum"), ("Diagonal", "diagonal")])
def test_trained_surrogates_are_loaded_as_they_were(trained, planar, family, seeds, full, kind, features):
    (folder, report), variant, c = trained, replace(full, variant=kind), seeds[:5].float()
    loaded, again = (pretraining.load_surrogates(folder, variant, planar, family) for _ in range(2))
    for network, twin in zip(loaded, again):
        assert not any(p.requires_grad for p in network.parameters()) and not network.training
        torch.testing.assert_close(network(c), twin(c))
        assert torch.isfinite(network(c)).all()
    assert report[f"r2_{features}"] < 1
    assert all(0 <= report[name] <= 1 for name in ("accuracy_paper", "accuracy_broad"))


def test_surrogates_of_another_arm_and_missing_ones_are_refused(trained, arm, planar, family, full, tmp_path):
    with pytest.raises(ArtifactError, match=r"success\.pt does not fit this arm"):
        pretraining.load_surrogates(trained[0], full, arm, Trajectory(7, 3))
    with pytest.raises(ArtifactError, match=r"there is no file .*success\.pt"):
        pretraining.load_surrogates(tmp_path, full, planar, family)
