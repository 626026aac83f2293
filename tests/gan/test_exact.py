from dataclasses import replace

import pytest
import torch

from sidegan.design.objectives import Term
from sidegan.design.problem import Problem
from sidegan.errors import InfeasibleError, ShapeError, SideganError
from sidegan.gan import TrajectoryGenerator
from sidegan.gan.exact import ExactFeatures
from sidegan.gan.terms import Formula
from sidegan.gan.training import Run, random_trajectories, train_variant
from sidegan.gan.variants import Exact
from sidegan.validity import Constraints, Plane, check
from tests.gan.conftest import NONE
from tests.tiny import tiny

WEIGHTS = replace(NONE, success=1000, fitness=1, distance=20, rank=20)
CONDITION = Term("log_condition", 1.0, 1)


def physics(*terms):
    return Exact({str(k): term for k, term in enumerate(terms)}, samples=24, reserve=0.03, ease=0.1)


@pytest.fixture(scope="module")
def exact():
    """A small exact variant."""
    sizes = {"epochs": 3, "steps": 40, "batch": 64, "noise": 12, "width": 64}
    configured = tiny("gan=exact").gan["exact"]
    return replace(configured, weights=WEIGHTS, learning_rate=4e-3, exact=physics(CONDITION), **sizes)


@pytest.fixture(scope="module")
def train(constraints, family):
    def run(variant, work, seeds=None, **options):
        once = Run("exact", 1, work, **{"evaluation": 200, **options})
        return train_variant(variant, constraints, family, seeds, once)

    return run


@pytest.fixture(scope="module")
def trained(train, exact, tmp_path_factory):
    return train(exact, tmp_path_factory.mktemp("trained"))


@pytest.fixture(scope="module")
def brief(exact):
    return replace(exact, epochs=1, steps=1)


@pytest.fixture(scope="module")
def untrained(train, brief, tmp_path_factory):
    """After one step."""
    return train(brief, tmp_path_factory.mktemp("brief"))


def test_without_seeds_it_becomes_valid_exciting_and_stays_diverse(trained, untrained, constraints, family):
    last = trained.history[-1]
    start = random_trajectories(constraints, family, 1)
    assert last["success"] > 0.9
    assert last["condition"] < 0.5 * untrained.history[0]["condition"]
    assert last["distance"] > 0.8 * torch.pdist(start[:500].flatten(1)).mean()


def test_every_sample_keeps_position_and_velocity_limits(untrained, constraints, family):
    c = untrained.generator.sample(300, 5)
    margins = check(constraints, family, c).margins
    assert (margins["position"] >= 0).all() and (margins["velocity"] >= 0).all()


def test_the_file_keeps_the_limits(untrained, planar, tmp_path):
    made = untrained.generator
    made.save(tmp_path / "generator.pt")
    again = TrajectoryGenerator.load(tmp_path / "generator.pt", planar)
    torch.testing.assert_close(again.sample(20, 3), made.sample(20, 3), rtol=0, atol=0)


def test_in_the_style_of_seeds_both_discriminators_work(train, exact, seeds, tmp_path):
    weights = replace(WEIGHTS, adversarial=0.3, features=0.3)
    variant = replace(exact, weights=weights, features="spectrum", batch=32)
    trained = train(replace(variant, epochs=2, steps=4), tmp_path, seeds)
    assert trained.history[-1]["success"] > 0.5
    with pytest.raises(ShapeError, match="exact learns from a seed set, got none"):
        train(variant, tmp_path / "none")


@pytest.mark.parametrize(
    "terms",
    [
        (Term("d_optimal", 1.0, 8),),
        (Term("a_optimal", 1.0, 1),),
        (Term("diagonal_ratio", 1.0, 1),),
        (CONDITION, Term("d_optimal", 0.5, 64)),
    ],
)
def test_every_objective_trains(train, exact, terms, tmp_path):
    variant = replace(exact, epochs=1, steps=3, exact=physics(*terms))
    assert len(train(variant, tmp_path).history) == 1


def test_an_interrupted_training_goes_on_where_it_was(train, exact, tmp_path):
    variant = replace(exact, steps=3)

    def stop(epoch, metrics):
        if epoch == 1:
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(variant, tmp_path, epoch_end=stop)
    epochs = []
    again = train(variant, tmp_path, epoch_end=lambda epoch, _: epochs.append(epoch))
    assert epochs == [2] and len(again.history) == 3
    assert torch.isfinite(again.generator.sample(9)).all()


def test_a_number_that_is_none_ends_the_training_and_keeps_the_last_epoch(
    train, exact, tmp_path, monkeypatch
):
    variant = replace(exact, steps=3)

    def spoil(epoch, metrics):
        if epoch == 0:
            monkeypatch.setattr(Formula, "forward", lambda self, batch: batch.coefficients.sum() * torch.nan)

    with pytest.raises(SideganError, match="exact diverged in epoch 1: the loss is nan; the last"):
        train(variant, tmp_path, epoch_end=spoil)
    monkeypatch.undo()
    assert len(train(variant, tmp_path).history) == 3


def test_training_goes_on_from_another_generator(train, brief, trained, untrained, tmp_path):
    warm = train(brief, tmp_path / "warm", start=trained.generator)
    assert warm.history[0]["condition"] < 0.7 * untrained.history[0]["condition"]
    with pytest.raises(ShapeError, match="the generator of planar2 has another shape"):
        train(replace(brief, width=32), tmp_path / "other", start=trained.generator)


def test_an_arm_that_cannot_move_is_told_before_the_training(exact, planar, family, tmp_path):
    weak = replace(planar, torque_limit=torch.full((2,), 1e-4, dtype=torch.float64))
    walls = [
        Plane((1, 0, 0), -0.0501),
        Plane((-1, 0, 0), -0.0501),
    ]  # a tenth of a millimetre beside the links
    for constraints, fault in ((Constraints(weak), "torque of"), (Constraints(planar, walls), "keep_out of")):
        constraints.refuse_home((0.0, 0.0))
        with pytest.raises(InfeasibleError, match=f"cannot even move a little .* violate {fault}"):
            train_variant(exact, constraints, family, None, Run("exact", 0, tmp_path))


def test_exact_features_are_standardised_over_the_seeds(constraints, family, seeds):
    problem = Problem(constraints, family, 40)
    for kind in ("spectrum", "diagonal"):
        features = ExactFeatures(problem, kind, seeds)
        y = features(seeds)
        torch.testing.assert_close(y.mean(0), torch.zeros(y.shape[1]), rtol=0, atol=1e-3)
        torch.testing.assert_close(y.std(0), torch.ones(y.shape[1]), rtol=1e-2, atol=1e-2)
