from dataclasses import replace

import pytest
import torch

from sidegan.errors import ArtifactError
from sidegan.gan.pretraining import load_surrogates
from sidegan.gan.settings import Reward
from sidegan.gan.tensors import tensor
from sidegan.motion.trajectory import Trajectory


def test_surrogates_learn_validity_and_features(pretrained):
    _, report, last = pretrained
    assert last == (440, 440)  # 40 epochs of 1020 samples
    assert report["accuracy_broad"] > 0.9 and report["accuracy_paper"] > 0.9
    assert report["r2_diagonal"] > 0.8 and report["r2_energies"] > 0.8


@pytest.mark.parametrize("kind", ["Diagonal", "Predicting"])
def test_trained_surrogates_load_frozen_and_identical(pretrained, planar, family, seeds, full, kind):
    reward = Reward(proportional=1.0, constant=1.0) if kind == "Predicting" else None
    variant, c = replace(full, variant=kind, reward=reward), tensor(seeds[:5]).float()
    loaded, again = (load_surrogates(pretrained[0], variant, planar, family) for _ in range(2))
    for network, twin in zip(loaded, again):
        assert not any(p.requires_grad for p in network.parameters()) and not network.training
        torch.testing.assert_close(network(c), twin(c))
        assert torch.isfinite(network(c)).all()


def test_surrogates_of_another_arm_and_missing_ones_are_refused(
    pretrained, arm, planar, family, full, tmp_path
):
    with pytest.raises(ArtifactError, match=r"success\.pt does not fit this arm"):
        load_surrogates(pretrained[0], full, arm, Trajectory(7, 3))
    with pytest.raises(ArtifactError, match=r"there is no file .*success\.pt"):
        load_surrogates(tmp_path, full, planar, family)
