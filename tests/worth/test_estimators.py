"""Estimators on one recording: each is good at what it is for, and wider intervals allow for misfit."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.identification import TorqueModel
from sidegan.plant.varied import VariedPlant
from sidegan.worth import Judge, legs, make_set
from sidegan.worth.estimators import compared, recorded
from sidegan.worth.intervals import Lacking, bias, recurring
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


def test_what_comes_back_is_told_from_noise():
    random = torch.Generator().manual_seed(0)
    order = torch.arange(30) % 4  # the first two pieces come eight times, the others seven
    back = torch.randn(4, 50, 2, generator=random, dtype=torch.float64) * torch.tensor([1.0, 0.0])
    noise = torch.randn(30, 50, 2, generator=random, dtype=torch.float64)
    found, true = recurring(back[order] + noise, order), back[order].square().sum((0, 1))
    assert float(found[0]) == pytest.approx(float(true[0]), rel=0.1)
    assert 0 <= float(found[1]) < 0.1 * float(noise.square().sum((0, 1))[1])
    once = recurring(noise[:4], torch.arange(4))  # nothing is repeated: all of it may come back
    torch.testing.assert_close(once, noise[:4].square().sum((0, 1)))


def test_bias_is_as_large_as_what_is_lacking_makes_the_parameters_wrong():
    """Least squares on random misfits of the sizes that were given, drawn again and again."""
    random = torch.Generator().manual_seed(0)
    y = torch.randn(60, 2, 3, generator=random, dtype=torch.float64)
    forms = torch.randn(60, 2, 4, generator=random, dtype=torch.float64)
    rows, nothing = y.transpose(0, 1), torch.zeros(3, 3, dtype=torch.float64)
    information, weights = rows.mT @ rows, torch.tensor([0.5, 2.0]).double()
    matrix = (information / weights[:, None, None]).sum(0)
    wrong, left = [], []
    for _ in range(2000):
        sizes = 3 * torch.randn(2, 4, generator=random, dtype=torch.float64)
        torque = torch.einsum("sjk,jk->sj", forms, sizes)
        parameters = torch.linalg.solve(matrix, torch.einsum("sjp,sj->p", y / weights[:, None], torque))
        residuals = torque - y @ parameters
        wrong.append(parameters)
        left.append(recurring(residuals[None], torch.zeros(1, dtype=torch.long)))
    lacks = Lacking.along(y, forms)
    told = bias(lacks, information, weights, nothing, torch.stack(left).mean(0))
    true = torch.stack(wrong).square().mean(0).sqrt()
    torch.testing.assert_close(told, true, rtol=0.05, atol=0)
    twice = bias(lacks, information, weights, nothing, 4 * torch.stack(left).mean(0))
    torch.testing.assert_close(twice, 2 * told)
