import math
import signal
from dataclasses import replace
from functools import partial
from typing import ClassVar

import numpy as np
import pytest
import torch

from sidegan.base.typed import changed
from sidegan.design.fidelity import mean_distance
from sidegan.errors import SideganError
from sidegan.gan.losses import Loss
from sidegan.gan.settings import GeneratorSettings
from sidegan.gan.side_gan import SideGAN
from sidegan.gan.training import random_trajectories
from sidegan.gan.variants import Vanilla
from sidegan.validity import check
from tests.gan.conftest import with_surrogates
from tests.refusals import refused


def same(made, other):
    """Whether two trainings have the same metrics and weights."""
    weights = other.generator.state_dict()
    alike = all(torch.equal(x, weights[name]) for name, x in made.generator.state_dict().items())
    return alike and made.history == other.history


def test_a_variant_with_every_loss_trains_and_leaves_its_surrogates(
    trained, full, taught, constraints, family, tmp_path
):
    ends, given = [], {name: x.clone() for name, x in taught.converter.state_dict().items()}
    made = trained(full, tmp_path, data=taught, progress=lambda *end: ends.append(end))
    assert ends == [(1, 3), (2, 3), (3, 3)] and len(made.history) == 3
    assert all(math.isfinite(row["distance"]) and 0 <= row["success"] <= 1 for row in made.history)
    c = made.generator.sample(100, 3)
    assert check(constraints, family, c).valid.mean() > 0.3
    assert all(torch.equal(x, given[name]) for name, x in taught.converter.state_dict().items())


class Late(Vanilla):
    """Its discriminator counts after the first epoch, and is kept after each."""

    kept: ClassVar[list] = []

    def losses(self):
        return [Loss(self.settings.weights.adversarial * (self.current_epoch > 0), self.discriminator)]

    def on_train_epoch_end(self):
        self.kept.append(self.discriminator.network.layers[0].weight.detach().clone())


def test_a_discriminator_whose_weight_comes_later_learns_from_then_on(trained, vanilla, tmp_path):
    variant = changed(vanilla, {"epochs": 3, "steps": 2, "weights": {"distance": 1.0}})
    trained(replace(variant, _target_=f"{__name__}.Late"), tmp_path)
    first, second, third = Late.kept
    assert not torch.equal(first, second) and not torch.equal(second, third)


def test_every_option_trains(trained, vanilla, tmp_path):
    free = {"gaussian_start": False, "limited": False}
    variant = changed(vanilla, {"epochs": 1, "steps": None, "generator": free})
    assert np.isfinite(trained(variant, tmp_path).generator.sample(5)).all()


@pytest.mark.parametrize("kind", ["predicting", "exact"])
def test_an_interrupted_training_resumes_to_the_same_result(
    trained, data, pretrained, request, kind, tmp_path
):
    variant = replace(request.getfixturevalue(kind), steps=3)
    given = with_surrogates(data, pretrained, variant) if variant.features else data
    first, second, trained = [], [], partial(trained, variant, data=given)

    def stop(done, total):
        first.append(done)
        if done == 2:
            raise KeyboardInterrupt

    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        trained(tmp_path, progress=stop)
    assert signal.getsignal(signal.SIGINT) is handler  # a second interrupt must be heard too
    made = trained(tmp_path, progress=lambda done, total: second.append(done))
    assert first == [1, 2] and second == [2, 3]  # the second epoch had not been saved
    assert same(made, trained(tmp_path / "whole"))


def test_the_learning_rate_schedule():
    falling = GeneratorSettings(learning_rate=2.0, warm_up=0.0, last_rate=0.1)
    assert [falling.rate(share) for share in (0, 0.5, 1)] == pytest.approx([2, 1.1, 0.2])
    level = replace(falling, last_rate=1.0, warm_up=0.1)
    assert [level.rate(share) for share in (0, 0.05, 0.1, 0.7)] == pytest.approx([0, 1, 2, 2])


def test_a_finished_training_is_reused_unless_its_checkpoint_is_damaged(trained, vanilla, tmp_path, caplog):
    done, ends, last = trained(vanilla, tmp_path), [], tmp_path / "last.ckpt"
    again = trained(vanilla, tmp_path, progress=lambda *end: ends.append(end))
    assert not ends and same(again, done)
    last.write_bytes(last.read_bytes()[:1000])
    again = trained(vanilla, tmp_path, progress=lambda *end: ends.append(end))
    assert len(ends) == 3 and same(again, done)
    assert f"the checkpoint {last} is damaged: the training starts over" in caplog.text


def test_a_nan_loss_ends_training_and_keeps_the_last_epoch(trained, vanilla, tmp_path, monkeypatch):
    def spoil(done, total):
        nan = torch.tensor(torch.nan)
        monkeypatch.setattr(SideGAN, "generator_loss", lambda *_: nan) if done == 2 else None

    with refused(SideganError, "small", "epoch 2", "nan"):
        trained(vanilla, tmp_path, progress=spoil)
    monkeypatch.undo()
    assert len(trained(vanilla, tmp_path).history) == 3


def test_exact_physics_trains_a_valid_diverse_generator_without_seeds(
    trained, exact, constraints, family, tmp_path
):
    made = trained(replace(exact, epochs=5), tmp_path, evaluation=600)
    last, start = made.history[-1], random_trajectories(constraints, family, 1)
    assert last["success"] > 0.9
    assert last["error_constant"] < made.history[0]["error_constant"]
    assert abs(last["cosine"]) < 0.1
    assert last["distance"] > 0.75 * mean_distance(start[:500])
    margins = check(constraints, family, made.generator.sample(300, 5)).margins
    assert (margins["position"] >= 0).all() and (margins["velocity"] >= 0).all()
