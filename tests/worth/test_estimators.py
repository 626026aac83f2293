"""Estimators on one recording: each is good at what it is for, and wider intervals allow for misfit."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.identification import TorqueModel
from sidegan.plant.varied import VariedPlant
from sidegan.worth import Judge, legs, make_set
from sidegan.worth.estimators import compared, recorded
from sidegan.worth.intervals import widened
from sidegan.worth.orders import Order


@pytest.fixture(scope="module")
def study(task, place):
    """A judge, a set, and a plant of each form with what it does on the tasks."""
    settings = replace(task.cfg.worth, outliers=0.02)
    judge = Judge(settings, TorqueModel(place.body, settings.model))
    contender = settings.contenders["random_8"]
    made = make_set(Order(place, task.trajectory.home, settings, contender, 6, np.random.SeedSequence(0)))
    random = torch.Generator().manual_seed(0)
    moves = [m for one in settings.tasks.values() for m in legs(place, one, settings.plant.rate, random)]
    plants = {
        form: VariedPlant(place.arm, settings.plant, form, np.random.SeedSequence(1))
        for form in ("linear", "eyring")
    }
    return judge, made, {form: (plant, judge.truth(plant, moves)) for form, plant in plants.items()}


def found(study, regime, outliers=False, seed=0):
    judge, made, plants = study
    one = judge.settings.regimes[regime]
    return compared(judge, plants[one.form][0], made, plants[one.form][1], one, outliers, seed)


def test_every_estimator_is_judged(study):
    one = found(study, "noise")
    assert set(one) == set(study[0].settings.estimators)
    for judged in one.values():
        assert 0 < judged.error < 0.5 and 0 <= judged.covered <= judged.widened <= 1


def test_huber_is_the_one_for_outliers(study):
    errors = [found(study, "noise", True, seed) for seed in range(3)]
    huber, weighted = (np.median([x[name].error for x in errors]) for name in ("huber", "weighted"))
    assert huber < 0.8 * weighted


def test_outliers_are_as_many_as_asked_for(study):
    judge, made, plants = study
    plant, regime = plants["linear"][0], judge.settings.regimes["noise"]
    clean, hit = (
        recorded(judge, plant, made, regime, outliers, np.random.default_rng(0)) for outliers in (False, True)
    )
    share = torch.cat([(a.torque != b.torque).double() for a, b in zip(clean, hit)]).mean()
    assert float(share) == pytest.approx(judge.settings.outliers, rel=0.3)


def test_intervals_are_widened_where_errors_belong_together():
    """Errors that are alike within each part: least squares drawn again and again."""
    random = torch.Generator().manual_seed(0)
    x = torch.randn(40, 25, 2, generator=random, dtype=torch.float64) + 1
    rows = x.flatten(0, 1)
    matrix, nothing = rows.T @ rows, torch.zeros(2, 2, dtype=torch.float64)
    told, spread = [], []
    for _ in range(400):
        noise = torch.randn(40, 1, generator=random, dtype=torch.float64).expand(40, 25)
        parameters = torch.linalg.solve(matrix, rows.T @ noise.flatten())
        residual = noise - x @ parameters
        told.append(widened(torch.einsum("ksp,ks->kp", x, residual), matrix, nothing))
        spread.append(parameters)
    plain = matrix.inverse().diagonal().sqrt()
    true = torch.stack(spread).std(0)
    torch.testing.assert_close(torch.stack(told).square().mean(0).sqrt(), true, rtol=0.15, atol=0)
    assert (true > 2 * plain).all()
