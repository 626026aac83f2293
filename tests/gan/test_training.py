import math
import signal
from dataclasses import replace

import pytest
import torch

from sidegan.base.storage import read_torch
from sidegan.design.objectives import Term
from sidegan.errors import SideganError
from sidegan.gan import training
from sidegan.gan.metrics import measure
from sidegan.gan.surrogates import Surrogates
from sidegan.gan.terms import Formula
from sidegan.gan.training import random_trajectories
from sidegan.validity import check
from tests.gan.conftest import random


def same_weights(one, other):
    return all(torch.equal(x, other.state_dict()[name]) for name, x in one.state_dict().items())


def test_every_loss_together_trains(train, full, predictor, converter, constraints, family, tmp_path):
    ends = []
    surrogates = Surrogates(predictor, converter)
    trained = train(full, tmp_path, surrogates=surrogates, epoch_end=lambda *end: ends.append(end))
    assert ends == list(enumerate(trained.history)) and len(ends) == 3
    assert all(math.isfinite(row["distance"]) and 0 <= row["success"] <= 1 for row in trained.history)
    c = trained.generator.sample(100, 3)
    assert check(constraints, family, c).valid.double().mean() > 0.3


def test_the_same_seed_gives_the_same_generator(train, vanilla, tmp_path):
    runs = [train(vanilla, tmp_path / str(i), seed, evaluation=0) for i, seed in enumerate((1, 1, 2))]
    samples = [run.generator.sample(10, 0) for run in runs]
    torch.testing.assert_close(samples[0], samples[1], rtol=0, atol=0)
    assert (samples[0] != samples[2]).any()


@pytest.mark.parametrize(
    "settings",
    [
        {"steps": None},
        {"gaussian_start": False},
        {"limited": True},
    ],
)
def test_every_option_trains(train, vanilla, settings, tmp_path):
    trained = train(replace(vanilla, epochs=1, **settings), tmp_path)
    assert len(trained.history) == 1
    assert torch.isfinite(trained.generator.sample(5)).all()


def test_what_is_measured_is_what_is_kept(train, vanilla, constraints, family, tmp_path):
    settings = replace(vanilla, least_valid=None, gaussian_start=False)
    trained = train(settings, tmp_path, evaluation=50)
    assert trained.epoch == 2
    noise = random(1_000_003 + 2)  # of the last epoch
    found = measure(constraints, family, trained.generator.sample(50, noise))
    assert found["distance"] == pytest.approx(trained.history[-1]["distance"], rel=1e-4)
    assert found["condition"] == pytest.approx(trained.history[-1]["condition"], rel=1e-2)


def test_the_generator_is_that_of_the_chosen_epoch(train, vanilla, tmp_path, monkeypatch):
    planted = iter((0.5, 0.9, 0.2))
    monkeypatch.setattr(training, "measure", lambda *_: {"success": next(planted), "condition_valid": 100.0})
    trained = train(replace(vanilla, least_valid=1.0), tmp_path)
    assert trained.epoch == 1
    kept, last = (read_torch(tmp_path / f"epoch-{epoch}.pt") for epoch in (1, 2))
    for name, weights in trained.generator.network.state_dict().items():
        torch.testing.assert_close(weights, kept[name], rtol=0, atol=0)
    assert any((kept[name] != last[name]).any() for name in kept)


@pytest.mark.parametrize("kind", ["vanilla", "exact"])
def test_an_interrupted_training_goes_on_where_it_was(train, vanilla, exact, kind, tmp_path):
    first, second = [], []
    variant = replace(exact, steps=3) if kind == "exact" else vanilla

    def stop(epoch, metrics):
        first.append((epoch, metrics))
        if epoch == 1:
            raise KeyboardInterrupt

    handler = signal.getsignal(signal.SIGINT)
    with pytest.raises(KeyboardInterrupt):
        train(variant, tmp_path, epoch_end=stop)
    assert signal.getsignal(signal.SIGINT) is handler  # a second interrupt must be heard too
    trained = train(variant, tmp_path, epoch_end=lambda *end: second.append(end))
    assert [epoch for epoch, _ in first + second] == [0, 1, 2]
    assert trained.history == [metrics for _, metrics in first + second]
    whole = train(variant, tmp_path / "whole")
    assert trained.history == whole.history
    assert same_weights(trained.generator.network, whole.generator.network)


def test_a_finished_training_is_not_done_again_unless_its_checkpoint_is_damaged(
    train, vanilla, tmp_path, caplog
):
    done, ends, last = train(vanilla, tmp_path), [], tmp_path / "last.ckpt"
    again = train(vanilla, tmp_path, epoch_end=lambda *end: ends.append(end))
    assert not ends and again.history == done.history
    assert same_weights(again.generator.network, done.generator.network)
    last.write_bytes(last.read_bytes()[:1000])
    again = train(vanilla, tmp_path, epoch_end=lambda *end: ends.append(end))
    assert len(ends) == 3 and again.history == done.history
    assert "last.ckpt is not a whole tensor file" in caplog.text


def test_a_loss_that_is_no_number_ends_the_training_and_keeps_the_last_epoch(
    train, exact, tmp_path, monkeypatch
):
    variant = replace(exact, steps=3)

    def spoil(epoch, metrics):
        if epoch == 0:
            monkeypatch.setattr(Formula, "forward", lambda self, batch: batch.coefficients.sum() * torch.nan)

    with pytest.raises(SideganError, match="small diverged in epoch 1: the loss is nan; the last"):
        train(variant, tmp_path, epoch_end=spoil)
    monkeypatch.undo()
    assert len(train(variant, tmp_path).history) == 3


def test_exact_physics_makes_valid_exciting_and_diverse_trajectories_without_seeds(
    train, exact, constraints, family, tmp_path
):
    trained = train(exact, tmp_path / "trained", evaluation=200)
    last, start = trained.history[-1], random_trajectories(constraints, family, 1)
    brief = train(replace(exact, epochs=1, steps=1), tmp_path / "brief", evaluation=200)
    assert last["success"] > 0.9
    assert last["condition"] < 0.5 * brief.history[0]["condition"]
    assert last["distance"] > 0.8 * torch.pdist(start[:500].flatten(1)).mean()
    margins = check(constraints, family, brief.generator.sample(300, 5)).margins
    assert (margins["position"] >= 0).all() and (margins["velocity"] >= 0).all()


@pytest.mark.parametrize(
    "terms",
    [
        (Term("d_optimal", 1.0, 8),),
        (Term("a_optimal", 1.0, 1), Term("diagonal_ratio", 1.0, 1)),
        (Term("log_condition", 1.0, 1), Term("log_condition", 6.0, 32)),
    ],
)
def test_every_objective_trains(train, exact, terms, tmp_path):
    physics = replace(exact.exact, terms={str(k): term for k, term in enumerate(terms)})
    assert len(train(replace(exact, epochs=1, steps=3, exact=physics), tmp_path).history) == 1
