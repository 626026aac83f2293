from dataclasses import replace

import pytest
import torch

from sidegan.design.objectives import Term
from sidegan.errors import ConfigError, InfeasibleError, ShapeError, SideganError
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.exact import ExactFeatures, ExactPhysics
from sidegan.gan.training import random_trajectories, train_variant
from sidegan.gan.variants import Exact, Variant, Weights
from sidegan.validity import Constraints, Plane, check
from tests.gan.conftest import random

WEIGHTS = Weights(adversarial=0, success=1000, fitness=1, distance=20, rank=20)


@pytest.fixture
def exact():
    """A small exact variant."""
    return Variant(
        "exact",
        weights=WEIGHTS,
        epochs=3,
        steps=40,
        batch=64,
        generator_steps=1,
        noise=12,
        width=64,
        learning_rate=4e-3,
        activation="silu",
        limited=True,
        clip=10.0,
        exact=Exact(samples=24),
    )


@pytest.fixture
def train(constraints, family):
    def run(variant, work, seeds=None, **options):
        return train_variant(
            variant, constraints, family, seeds, work, seed=1, **{"evaluation": 200, **options}
        )

    return run


def test_without_seeds_it_becomes_valid_exciting_and_stays_diverse(
    train, exact, constraints, family, tmp_path
):
    trained = train(exact, tmp_path)
    last = trained.history[-1]
    start = random_trajectories(constraints, family, 1)
    assert last["success"] > 0.9
    assert (
        last["condition"]
        < 0.5 * train(replace(exact, epochs=1, steps=1), tmp_path / "0").history[0]["condition"]
    )
    assert last["distance"] > 0.8 * torch.pdist(start[:500].flatten(1)).mean()


def test_every_sample_keeps_position_and_velocity_limits(train, exact, constraints, family, tmp_path):
    c = train(replace(exact, epochs=1, steps=1), tmp_path).generator.sample(300, 5)
    margins = check(constraints, family, c).margins
    assert (margins["position"] >= 0).all() and (margins["velocity"] >= 0).all()


def test_the_file_keeps_the_limits(train, exact, planar, tmp_path):
    made = train(replace(exact, epochs=1, steps=2), tmp_path).generator
    made.save(tmp_path / "generator.pt")
    again = TrajectoryGenerator.load(tmp_path / "generator.pt", planar)
    torch.testing.assert_close(again.sample(20, 3), made.sample(20, 3), rtol=0, atol=0)


def test_in_the_style_of_seeds_both_discriminators_work(train, exact, seeds, tmp_path):
    weights = replace(WEIGHTS, adversarial=0.3, features=0.3)
    variant = replace(exact, name="exact_adversarial", weights=weights, features="spectrum", batch=32)
    trained = train(replace(variant, epochs=2, steps=4), tmp_path, seeds)
    assert trained.history[-1]["success"] > 0.5
    with pytest.raises(ShapeError, match="exact_adversarial learns from a seed set, got none"):
        train(variant, tmp_path / "none")


@pytest.mark.parametrize(
    "terms",
    [
        (Term("d_optimal", 1.0, 8),),
        (Term("a_optimal"),),
        (Term("diagonal_ratio"),),
        (Term("log_condition"), Term("d_optimal", 0.5, 64)),
    ],
)
def test_every_objective_trains(train, exact, terms, tmp_path):
    variant = replace(exact, epochs=1, steps=3, exact=Exact(terms, samples=24))
    assert len(train(variant, tmp_path).history) == 1


def test_an_interrupted_training_goes_on_where_it_was(train, exact, tmp_path):
    variant = replace(exact, steps=3)

    def stop(epoch, metrics):
        if epoch == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(variant, tmp_path, epoch_end=stop)
    told = []
    again = train(variant, tmp_path, epoch_end=lambda epoch, _: told.append(epoch))
    assert told == [2] and len(again.history) == 3
    assert torch.isfinite(again.generator.sample(9)).all()


def test_a_number_that_is_none_ends_the_training_and_keeps_the_last_epoch(
    train, exact, tmp_path, monkeypatch
):
    variant = replace(exact, steps=3)

    def spoil(epoch, metrics):
        if epoch == 0:
            monkeypatch.setattr(ExactPhysics, "violation", lambda self, c: c.flatten(1).sum(1) * torch.nan)

    with pytest.raises(SideganError, match="exact diverged in epoch 1: the loss is nan; the last"):
        train(variant, tmp_path, epoch_end=spoil)
    monkeypatch.undo()
    assert len(train(variant, tmp_path).history) == 3


def test_training_goes_on_from_another_generator(train, exact, tmp_path):
    first = train(exact, tmp_path / "first").generator
    short = replace(exact, epochs=1, steps=1)
    cold, warm = train(short, tmp_path / "cold"), train(short, tmp_path / "warm", start=first)
    assert warm.history[0]["condition"] < 0.7 * cold.history[0]["condition"]
    with pytest.raises(ShapeError, match="the generator of planar2 has another shape"):
        train(replace(short, width=32), tmp_path / "other", start=first)


def test_an_arm_that_cannot_move_is_told_before_the_training(exact, planar, family, tmp_path):
    weak = replace(planar, torque_limit=torch.full((2,), 1e-4, dtype=torch.float64))
    walls = [
        Plane((1, 0, 0), -0.0501),
        Plane((-1, 0, 0), -0.0501),
    ]  # a tenth of a millimetre beside the links
    for constraints, fault in ((Constraints(weak), "torque of"), (Constraints(planar, walls), "keep_out of")):
        constraints.refuse_home((0.0, 0.0))
        with pytest.raises(InfeasibleError, match=f"cannot even move a little .* violate {fault}"):
            train_variant(exact, constraints, family, None, tmp_path, seed=0)


def test_exact_features_are_standardised_over_the_seeds(constraints, family, seeds):
    problem = ExactPhysics(constraints, family, Exact()).problem
    for kind in ("spectrum", "diagonal"):
        features = ExactFeatures(problem, kind, seeds)
        y = features(seeds)
        torch.testing.assert_close(y.mean(0), torch.zeros(y.shape[1]), rtol=0, atol=1e-3)
        torch.testing.assert_close(y.std(0), torch.ones(y.shape[1]), rtol=1e-2, atol=1e-2)


def test_what_is_missing_or_impossible_is_refused(exact):
    with pytest.raises(ConfigError, match="one objective or more"):
        Exact(terms=())
    with pytest.raises(ConfigError, match="ease is 0"):
        Exact(ease=0.0)
    with pytest.raises(ConfigError, match="objective of exact is of 100 trajectories, its batch 64"):
        replace(exact, exact=Exact((Term("log_condition", together=100),)))
    with pytest.raises(ConfigError, match="batch of exact must be at least 2"):
        replace(exact, batch=1)


def test_rank_is_missed_by_a_batch_with_few_directions(constraints, family):
    from sidegan.gan.diversity import Diversity

    c = random_trajectories(constraints, family, 0).float()
    losses = Diversity(c, 100)
    assert losses.rank_loss(c[:100]) < 0.1
    vectors = torch.randn(2, c[0].numel(), generator=random())
    flat = (torch.randn(100, 2, generator=random()) @ vectors).view(100, *c.shape[1:]).requires_grad_(True)
    value = losses.rank_loss(flat)
    (slope,) = torch.autograd.grad(value, flat)
    assert value > 1 and torch.isfinite(slope).all()
    assert losses.rank_loss(flat.detach() - 0.5 * slope / slope.norm()) < value
