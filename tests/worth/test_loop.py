"""The closed loop: honest about what is known, and the next trajectory chosen for what is not."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
import torch
import yaml

from sidegan.base.typed import build
from sidegan.design.information import information_of
from sidegan.design.prediction import Prediction
from sidegan.designer import Designer, DesignerSettings
from sidegan.errors import ConfigError
from sidegan.identification import TorqueModel
from sidegan.pipeline.run import CONF
from sidegan.plant.varied import VariedPlant
from sidegan.validity import check
from sidegan.worth import Judge, SetOf, legs
from sidegan.worth.contenders import aim_of, exact
from sidegan.worth.intervals import true_parameters
from sidegan.worth.loop import Designed, Listed, Picked, Predicted, Step, closed, seconds_to
from sidegan.worth.orders import Order
from sidegan.worth.session import Known, Session

PERIOD = 4.0  # [s]


@pytest.fixture(scope="module")
def order(task, place):
    settings = task.cfg.worth
    contender = replace(settings.contenders["random_8"], period=PERIOD)
    return Order(place, task.trajectory.home, settings, contender, 3, np.random.SeedSequence(2))


@pytest.fixture(scope="module")
def judge(task, place):
    return Judge(task.cfg.worth, TorqueModel(place.body, task.cfg.worth.model))


@pytest.fixture(scope="module")
def plant(task, place):
    return VariedPlant(place.arm, task.cfg.worth.plant, "linear", np.random.SeedSequence(1))


@pytest.fixture(scope="module")
def pool(order):
    generator = torch.Generator().manual_seed(3)
    drawn = order.problem().start(60, generator, 0.7)
    valid = check(order.constraints, order.family(), drawn).valid
    return drawn[valid][:8]


@pytest.fixture(scope="module")
def session(judge, plant, order, pool):
    """A plant that has executed two trajectories."""
    made = Session(judge, plant, judge.settings.regimes["noise"], seed=0)
    made.execute(SetOf(order.family(), pool[:2]))
    return made


def quiet(settings):
    sensors = replace(settings.sensors, noise=0.0, cutoff=60.0)
    return replace(settings, sensors=sensors, plant=replace(settings.plant, encoder=0.0), believed=1e3)


def test_without_noise_the_parameters_are_found(judge, order, pool):
    settings = quiet(judge.settings)
    plant = VariedPlant(judge.model.arm, settings.plant, "linear", np.random.SeedSequence(1))
    silent = Session(replace(judge, settings=settings), plant, settings.regimes["noise"], 0)
    known, true = silent.execute(SetOf(order.family(), pool[:4])), true_parameters(plant, judge.model)
    torch.testing.assert_close(known.parameters, true, rtol=0.02, atol=0.02 * float(true.abs().max()))
    assert silent.seconds == 4 * PERIOD


def test_the_noise_that_residuals_show_is_that_of_the_sensors(session):
    """A mean over 1 s of noise of deviation s that keeps its sign for τ has the variance 2 τ s²."""
    sensors = session.judge.settings.sensors
    expected = 2 * sensors.correlation * (sensors.noise * session.scale) ** 2
    assert (session.known.intensity / expected).log().abs().max() < np.log(1.8)


def test_intervals_cover_the_true_parameters(judge, plant, order, pool):
    true, shares, deviations = true_parameters(plant, judge.model), [], []
    for seed in range(6):
        one = Session(judge, plant, judge.settings.regimes["noise"], seed)
        known = one.execute(SetOf(order.family(), pool[:2]))
        shares.append(known.covered(true))
        deviations.append((known.parameters - true) / known.covariance.diagonal().sqrt())
    assert 0.85 < np.mean(shares) <= 1
    assert 0.4 < float(torch.stack(deviations).square().mean().sqrt()) < 1.5


def test_each_recording_has_noise_of_its_own_and_tells_more(judge, plant, order, pool):
    same = pool[:1].expand(2, -1, -1, -1)
    one = Session(judge, plant, judge.settings.regimes["noise"], 0)
    first = one.execute(SetOf(order.family(), same[:1]))
    second = one.execute(SetOf(order.family(), same[:1]))
    assert not torch.allclose(first.parameters, second.parameters, rtol=1e-6)
    gain = torch.logdet(second.information) - torch.logdet(first.information)
    assert 0 < float(gain) < judge.model.count * np.log(4)


def test_what_is_known_of_rigid_bodies_is_what_remains_without_the_rest(session, judge):
    """The Schur complement of the friction's block, in the orthonormal basis."""
    q, information = judge.model.rigid, session.known.information
    a, b, d = information[:q, :q], information[:q, q:], information[q:, q:]
    subspace = judge.model.body.base.subspace
    expected = subspace.T @ (a - b @ torch.linalg.solve(d, b.T)) @ subspace
    torch.testing.assert_close(session.known.rigid(judge.model), expected, rtol=1e-6, atol=1e-6)


def gains(session, judge, family, c):
    """Gain of log det of rigid bodies' information by trajectories (N, J, H, 2), one alone each."""
    deviation = (session.known.intensity / family.period).sqrt()
    prior = session.known.rigid(judge.model)
    found = information_of(judge.model.body, family, c, deviation=deviation).matrices(slice(None))
    return torch.logdet(prior + found) - torch.logdet(prior)


def test_the_best_of_the_pool_is_picked(session, judge, order, pool):
    picked = Picked(judge.model, order.family(), pool).next(session.known)
    best = pool[int(gains(session, judge, order.family(), pool).argmax())]
    assert torch.equal(picked, best)


@pytest.fixture(scope="module")
def designer(place, order):
    values = yaml.safe_load((CONF / "designer" / "default.yaml").read_text(encoding="utf-8"))
    return Designer(place, order.family(), build(DesignerSettings, values))


def beside(session, judge, family, one):
    """Information on the whole model after one more trajectory, (J, H, 2)."""
    states = [x[0] for x in family.roll_out(one[None], family.grid(400))[1:]]
    y = judge.model.regressor(*states)
    weights = family.period / session.known.intensity / len(y)
    return session.known.information + torch.einsum("sjp,j,sjq->pq", y, weights, y)


def test_what_is_designed_tells_more_than_the_best_of_the_pool(session, judge, order, pool, designer):
    """Of the whole model, friction included: by log det, and by what it was asked for."""
    family, tasks = order.family(), aim_of(order, Prediction).tasks
    aims = [
        (None, lambda whole: -float(torch.logdet(whole))),
        (tasks, lambda whole: float((tasks * torch.linalg.inv(whole)).sum())),
    ]
    for wanted, worth in aims:
        c = Designed(judge.model, designer, 80, wanted).next(session.known)
        assert check(order.constraints, family, c[None]).valid.all()
        best = min(worth(beside(session, judge, family, one)) for one in pool)
        assert worth(beside(session, judge, family, c)) < best


def test_what_is_predicted_beats_the_pool_by_its_own_aim(session, judge, order, pool):
    aim, problem = aim_of(order, Prediction), order.problem()
    way = Predicted(problem, aim, judge.settings.search, torch.Generator().manual_seed(0))
    first, second = way.next(session.known), way.next(session.known)
    assert check(order.constraints, order.family(), torch.stack([first, second])).valid.all()
    assert not torch.equal(first, second)
    aim.believe(session.known.information, 1 / session.known.intensity)
    variance = aim.parts()[0] ** 0.5
    assert variance == pytest.approx(session.known.deviation(aim.tasks), rel=1e-3)


def test_the_loop_goes_on_from_what_is_known(judge, plant, order, pool):
    family, aim = order.family(), aim_of(exact(order), Prediction)
    moves = [m for one in judge.settings.tasks.values() for m in legs(
        order.constraints, replace(one, count=2), 500.0, torch.Generator().manual_seed(0)
    )]  # fmt: skip
    truth, regime = judge.truth(plant, moves), judge.settings.regimes["noise"]
    true, ends = true_parameters(plant, judge.model), {}
    search = replace(judge.settings.search, starts=4, rough=10, strict=20)
    designed = Predicted(order.problem(), aim, search, torch.Generator().manual_seed(0))
    ways = {"for the tasks": designed, "listed": Listed(pool)}
    for name, way in ways.items():
        steps = closed(Session(judge, plant, regime, 0), way, family, 3, aim.tasks, truth, true)
        assert [one.seconds for one in steps] == [PERIOD, 2 * PERIOD, 3 * PERIOD]
        assert all(a.deviation > b.deviation for a, b in itertools.pairwise(steps))
        ends[name] = steps[-1].deviation
        assert seconds_to(steps, steps[1].deviation) == 2 * PERIOD
        assert seconds_to(steps, 0.0) == np.inf
    assert ends["for the tasks"] < 0.9 * ends["listed"]


def test_a_list_begins_anew(pool, session):
    way = Listed(pool[:2])
    found = [way.next(session.known) for _ in range(3)]
    assert torch.equal(found[0], found[2]) and not torch.equal(found[0], found[1])


def test_what_cannot_be_judged_is_refused(judge, plant, task, place):
    with pytest.raises(ConfigError, match="without drift"):
        Session(judge, plant, judge.settings.regimes["drift"], 0)


def test_friction_of_another_form_has_no_true_parameters(judge, plant, task, place):
    other = VariedPlant(place.arm, task.cfg.worth.plant, "eyring", np.random.SeedSequence(1))
    linear, lacking = (true_parameters(one, judge.model) for one in (plant, other))
    assert linear.isfinite().all()
    known = lacking.isfinite()
    assert known[: judge.model.rigid].all() and not known[judge.model.rigid :].all()
    torch.testing.assert_close(lacking[known], linear[known])


def test_intervals_count_what_they_hold():
    known = Known(torch.tensor([0.0, 1.0]).double(), torch.eye(2).double(), torch.ones(2).double())
    assert known.covered(torch.tensor([1.9, 3.1]).double()) == 0.5
    assert seconds_to([Step(8.0, 0.1, 0.0, 1.0, 0.0, known)], 0.1) == 8.0
