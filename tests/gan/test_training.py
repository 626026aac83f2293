import math
import signal
from dataclasses import replace

import pytest
import torch

from sidegan.base.storage import read_torch
from sidegan.errors import ShapeError, SideganError
from sidegan.gan import training
from sidegan.gan.metrics import measure
from sidegan.gan.surrogates import Surrogates
from sidegan.gan.training import Run, train_variant
from sidegan.validity import check
from tests.gan.conftest import random


@pytest.fixture
def train(constraints, family, seeds):
    def run(variant, work, seed=1, surrogates=None, **options):
        once = Run("vanilla", seed, work, **{"evaluation": 20, **options})
        return train_variant(variant, constraints, family, seeds[:64], once, surrogates or Surrogates())

    return run


def test_every_loss_together_trains(train, full, predictor, converter, constraints, family, tmp_path):
    ends = []
    surrogates = Surrogates(predictor, converter)
    trained = train(full, tmp_path, surrogates=surrogates, epoch_end=lambda *end: ends.append(end))
    assert [epoch for epoch, _ in ends] == [0, 1, 2]
    assert [metrics for _, metrics in ends] == trained.history
    assert all(math.isfinite(row["distance"]) and 0 <= row["success"] <= 1 for row in trained.history)
    c = trained.generator.sample(100, 3)
    assert c.shape == (100, *family.shape) and torch.isfinite(c).all()
    assert check(constraints, family, c).valid.double().mean() > 0.3
    assert trained.generator.robot == "planar2" and trained.generator.variant == "vanilla"


def test_the_same_seed_gives_the_same_generator(train, vanilla, tmp_path):
    runs = [train(vanilla, tmp_path / str(i), seed, evaluation=0) for i, seed in enumerate((1, 1, 2))]
    samples = [run.generator.sample(10, 0) for run in runs]
    torch.testing.assert_close(samples[0], samples[1], rtol=0, atol=0)
    assert (samples[0] != samples[2]).any()
    assert runs[0].history == [{}, {}, {}]


@pytest.mark.parametrize(
    "settings",
    [
        {"body": "conv"},
        {"body": "dcgan", "scaling": "range", "gaussian_start": False, "minibatch": False},
        {"average": 0.9},
        {"scaling": "range", "gaussian_start": False},
        {"minibatch": False, "decay": False, "gradient_penalty": 0.0},
        {"steps": None},
    ],
)
def test_every_option_trains(train, vanilla, settings, tmp_path):
    trained = train(replace(vanilla, epochs=1, **settings), tmp_path)
    assert len(trained.history) == 1
    assert torch.isfinite(trained.generator.sample(5)).all()


@pytest.mark.parametrize("body", ["mlp", "dcgan"])
def test_what_is_measured_is_what_is_kept(train, vanilla, constraints, family, body, tmp_path):
    plain = {"scaling": "range", "gaussian_start": False, "minibatch": False}
    variant = replace(vanilla, body=body, average=0.5, least_valid=None, **plain)
    trained = train(variant, tmp_path, evaluation=50)
    assert trained.epoch == 2
    noise = random(1_000_003 + 2)  # of the last epoch
    found = measure(constraints, family, trained.generator.sample(50, noise))
    assert found["distance"] == pytest.approx(trained.history[-1]["distance"], rel=1e-4)
    assert found["condition"] == pytest.approx(trained.history[-1]["condition"], rel=1e-2)


def test_the_generator_is_that_of_the_chosen_epoch(train, vanilla, tmp_path, monkeypatch):
    planted = iter((0.5, 0.9, 0.2))
    row = {"condition_valid": 100.0}
    monkeypatch.setattr(training, "measure", lambda *_: {"success": next(planted), **row})
    trained = train(replace(vanilla, least_valid=1.0), tmp_path)
    assert trained.epoch == 1
    kept, last = (read_torch(tmp_path / f"epoch-{epoch}.pt") for epoch in (1, 2))
    for name, weights in trained.generator.network.state_dict().items():
        torch.testing.assert_close(weights, kept[name], rtol=0, atol=0)
    assert any((kept[name] != last[name]).any() for name in kept)


@pytest.mark.parametrize("average", [None, 0.9])
def test_an_interrupted_training_goes_on_where_it_was(train, vanilla, average, tmp_path):
    first, second, vanilla = [], [], replace(vanilla, average=average)

    def stop(epoch, metrics):
        first.append((epoch, metrics))
        if epoch == 1:
            raise KeyboardInterrupt

    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        train(vanilla, tmp_path, epoch_end=stop)
    assert signal.getsignal(signal.SIGINT) is handler  # a second interrupt must be heard too
    assert (tmp_path / "last.ckpt").exists()

    trained = train(vanilla, tmp_path, epoch_end=lambda *end: second.append(end))
    assert [epoch for epoch, _ in first] == [0, 1]
    assert [epoch for epoch, _ in second] == [2]
    assert trained.history == [metrics for _, metrics in first + second]
    whole = train(vanilla, tmp_path / "whole")
    assert trained.history == whole.history
    for name, weights in trained.generator.network.state_dict().items():
        torch.testing.assert_close(weights, whole.generator.network.state_dict()[name], rtol=0, atol=0)


def test_a_finished_training_is_not_done_again(train, vanilla, tmp_path):
    done = train(vanilla, tmp_path)
    ends = []
    again = train(vanilla, tmp_path, epoch_end=lambda *end: ends.append(end))
    assert not ends and again.history == done.history
    torch.testing.assert_close(again.generator.sample(5), done.generator.sample(5), rtol=0, atol=0)


def test_a_damaged_checkpoint_is_told_and_not_used(train, vanilla, tmp_path, caplog):
    done = train(vanilla, tmp_path)
    last = tmp_path / "last.ckpt"
    last.write_bytes(last.read_bytes()[:1000])
    again = train(vanilla, tmp_path)
    assert "last.ckpt is not a whole tensor file" in caplog.text and "begins anew" in caplog.text
    assert again.history == done.history


def test_a_divergence_is_told(train, vanilla, tmp_path):
    with pytest.raises(SideganError, match="vanilla diverged in epoch 0"):
        train(replace(vanilla, learning_rate=1e38), tmp_path)


def test_seeds_that_do_not_fit_are_refused(constraints, family, seeds, vanilla, tmp_path):
    for bad, message in [
        (seeds[:1], "two seeds, got 1"),
        (seeds[:, :1], "coefficients are"),
        (seeds * torch.nan, "not finite"),
    ]:
        with pytest.raises(ShapeError, match=message):
            train_variant(vanilla, constraints, family, bad, Run("vanilla", 0, tmp_path))
