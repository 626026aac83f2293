"""The study: contenders under the same limits, exact where it must be, and with a sense for bad sets."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from experiments import worth as page
from experiments import worth_measures as measures
from sidegan.errors import ConfigError
from sidegan.identification import TorqueModel
from sidegan.pipeline.run import run_stages
from sidegan.pipeline.stages import stage
from sidegan.pipeline.stages.worth import arms, contenders, expected, groups, load, plants, sets, worth
from sidegan.pipeline.store import Store
from sidegan.plant.varied import VariedPlant
from sidegan.validity import Constraints, Plane, check
from sidegan.worth import MAKERS, Estimate, Judge, estimate, legs, make_set
from sidegan.worth.cost import Pace, cost
from sidegan.worth.curves import disturbed, mean_error
from sidegan.worth.intervals import deviations, held
from sidegan.worth.orders import Order
from sidegan.worth.tasks import states


@pytest.fixture(scope="module")
def order(task, place):
    def make(name, count=2, seed=0):
        settings = task.cfg.worth
        source = np.random.SeedSequence(seed)
        return Order(place, task.trajectory.home, settings, settings.contenders[name], count, source)

    return make


def maker_of(name, task):
    return next(key for key, one in task.cfg.worth.contenders.items() if one.maker == name)


FROM_FILES = {"library", "waypoints"}


@pytest.mark.parametrize("maker", sorted(set(MAKERS) - FROM_FILES))
def test_every_contender_is_valid_under_the_same_limits_and_repeatable(task, place, order, maker):
    one, again, other = (make_set(order(maker_of(maker, task), seed=s)) for s in (1, 1, 2))
    assert check(place, one.family, one.coefficients).valid.all()
    assert torch.equal(one.coefficients, again.coefficients)
    assert not torch.equal(one.coefficients, other.coefficients)
    assert "acceleration" in place.higher


def test_an_unknown_maker_is_refused(order):
    one = order("random_8")
    wrong = replace(one, contender=replace(one.contender, maker="magic"))
    with pytest.raises(ConfigError, match="'magic' makes no sets"):
        make_set(wrong)


def changed(settings, name, **values):
    contenders = {**settings.contenders, name: replace(settings.contenders[name], **values)}
    return replace(settings, contenders=contenders)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda x: changed(x, "random_8", period=6.0), "a period is 6.0 s, expected a multiple of 4 s"),
        (lambda x: changed(x, "prediction", options={"or": 2.0}), "a period is 2.0 s"),
        (lambda x: changed(x, "excite", options={"poool": 3.0}), r"options has \['poool'\]"),
        (lambda x: replace(x, horizon=30.0), "worth.horizon is 30.0 s"),
        (
            lambda x: replace(x, sensors=replace(x.sensors, rate=60.0)),
            "expected a multiple of the sensors' 60",
        ),
        (lambda x: replace(x, contenders={"tiny": x.contenders["tiny"]}, estimated="tiny"), "none is ours"),
        (
            lambda x: replace(x, contenders={"p": x.contenders["prediction"]}, estimated="p"),
            "none is practice",
        ),
    ],
)
def test_a_study_that_could_not_be_judged_is_refused(task, change, message):
    with pytest.raises(ConfigError, match=message):
        change(task.cfg.worth)


def test_the_error_is_taken_until_the_horizon(task, place):
    for horizon, last in ((32.0, 28.0), (36.0, 32.0), (1000.0, 560.0)):
        settings = replace(task.cfg.worth, horizon=horizon)
        times = Judge(settings, TorqueModel(place.body, settings.model)).times
        assert times[-2:].tolist() == [last, horizon] and (np.diff(times) > 0).all()


def test_sets_of_one_contender_may_differ_in_their_period(task, place, order):
    settings = task.cfg.worth
    judge = Judge(settings, TorqueModel(place.body, settings.model))
    plant = VariedPlant(place.arm, settings.plant, "linear", np.random.SeedSequence(1))
    short, long = (make_set(order(name, 2)) for name in ("random_8", "random_16"))
    mixed = judge.followed(plant, [short, long, short])
    for one, alone in zip(mixed, (short, long, short)):
        for x, apart in zip(one, judge.followed(plant, [alone])[0]):
            torch.testing.assert_close(x, apart, rtol=1e-9, atol=1e-9)
    assert mixed[1][1].shape[1] == 2 * mixed[0][1].shape[1]


def test_without_sets_that_are_known_to_be_bad_nothing_is_said_of_them(small, run):
    found = page.collect(small)
    assert set(measures.discerning(found)) == {small.arm.name}
    study = small.cfg.worth
    good = replace(study, contenders={x: one for x, one in study.contenders.items() if not one.bad})
    assert measures.discerning(replace(found, cfg=replace(small.cfg, worth=good))) == {}


def test_a_study_costs_what_its_parts_do(task):
    """One contender by hand, then another one that is not designed, more plants, twice the sets."""
    one = task.cfg.worth.contenders["prediction"]
    settings = replace(task.cfg.worth, plants=2, compared=1)
    rate, motions = settings.plant.rate, settings.sets * settings.count(one)
    moves = Pace(step=1e-4, motion=1e-5, state=2e-5, gradient=0.0)
    moved = one.period * rate * (1e-4 + 1e-5 * motions) + motions * one.period * settings.sensors.rate * 2e-5
    both = {"p": one, "q": replace(one, maker="random", practice=True)}
    found = cost(settings, both, moves)  # two forms on each plant are judged, a third one on the first alone
    assert found.plants == pytest.approx(2 * (2 * 2 + 1) * moved) and found.design == 0
    assert cost(replace(settings, plants=3), both, moves).plants == pytest.approx(2 * (3 * 2 + 1) * moved)
    search, dear = settings.search, Pace(0.0, 0.0, 0.0, 1.0)
    gradients = search.starts * (0.5 * search.rough + search.strict) * search.samples * one.period
    assert cost(settings, both, dear) == pytest.approx((motions * gradients, 0.0))
    twice = replace(settings, sets=2 * settings.sets)
    assert cost(twice, both, dear).total == pytest.approx(2 * motions * gradients)


def test_what_is_left_to_be_made_is_told_beforehand(task, tmp_path, caplog):
    new = replace(task, store=Store(tmp_path))
    with caplog.at_level("INFO"):
        stage("worth").check(new)
    assert "of CPU time" in caplog.text and "idle cores" in caplog.text
    times = expected(new)
    assert 0 < times.design < 600 and 0 < times.plants < 600


def test_one_joint_at_a_time_moves_one_joint(order):
    c = make_set(order("single")).coefficients
    assert ((c != 0).flatten(2).any(2).sum(1) == 1).all()


def test_tasks_begin_and_end_at_rest_within_the_limits(task, place):
    for one in task.cfg.worth.tasks.values():
        moves = legs(place, one, 100.0, torch.Generator().manual_seed(0))
        assert len(moves) == one.count
        for move in moves:
            assert move.velocity[0, [0, -1]].abs().max() < 1e-9
        q, dq, ddq = states(moves, 1)
        margins = place.margins(q, dq, ddq)
        assert all(float(x.min()) >= 0 for x in margins.values())
        assert (dq.abs().amax(0) / place.arm.velocity_limit).max() <= one.velocity


@pytest.fixture(scope="module")
def judged(task, place, order):
    """Errors on a plant whose friction is of the model's class, without noise and hardly filtered."""
    settings = task.cfg.worth
    sensors = replace(settings.sensors, noise=0.0, temperature=0.0, bias=0.0, cutoff=60.0)
    plant = replace(settings.plant, encoder=0.0)
    settings = replace(settings, sensors=sensors, plant=plant, believed=1e3)
    judge = Judge(settings, TorqueModel(place.body, settings.model))
    made = VariedPlant(place.arm, plant, "linear", np.random.SeedSequence(1))
    random = torch.Generator().manual_seed(0)
    moves = [m for one in settings.tasks.values() for m in legs(place, one, plant.rate, random)]
    truth = judge.truth(made, moves)
    regimes = {"noise": settings.regimes["noise"]}
    return truth, judge.curves(made, [make_set(order("random_8", 4))], truth, regimes, 0)["noise"].errors


def test_without_noise_and_misfit_the_plant_is_identified(judged):
    truth, errors = judged
    assert float(truth.floor()) < 2e-3
    assert errors.shape[::2] == (1, 2)
    assert float(errors[0, -1].max()) < 1e-2


def test_deviations_are_those_of_repeated_least_squares():
    """Two joints, weights that do not fit the errors: drawn again and again."""
    random = torch.Generator().manual_seed(0)
    rows = torch.randn(2, 300, 4, generator=random, dtype=torch.float64)
    sigma, weights = torch.tensor([0.5, 3.0]).double(), torch.tensor([1.0, 2.0]).double()
    information, prior = rows.mT @ rows, 1e-9 * torch.eye(4, dtype=torch.float64)
    noise = torch.randn(3000, 2, 300, generator=random, dtype=torch.float64) * sigma[:, None]
    right = torch.einsum("jsp,njs,j->np", rows, noise, 1 / weights)
    found = torch.linalg.solve((information / weights[:, None, None]).sum(0), right.T).T
    told = deviations(information, weights, sigma**2, prior)
    torch.testing.assert_close(found.std(0), told, rtol=0.06, atol=0)
    shares = torch.stack([held(x, told, torch.zeros(4).double()) for x in found])
    assert float(shares.mean()) == pytest.approx(0.95, abs=0.01)


def test_no_parameters_predict_nothing(judged):
    truth, _ = judged
    nothing = truth.errors(torch.zeros(truth.moment.shape[1], dtype=torch.float64))
    assert (nothing >= 1 - 1e-9).all()  # the square's mean is its variance or more


def test_noise_and_drift_have_their_sizes(task):
    sensors = replace(task.cfg.worth.sensors, noise=0.1, temperature=0.2, bias=0.0)
    friction = 3 * torch.ones(4000, 20, 2, dtype=torch.float64)
    scale = np.array([1.0, 10.0])
    quiet, drifting = (
        disturbed(friction, scale, sensors, drift, 2, np.random.default_rng(0)).numpy()
        for drift in (False, True)
    )
    assert quiet.std((0, 1)) == pytest.approx(0.1 * scale, rel=0.05)
    slow = drifting - disturbed(friction, scale, sensors, False, 2, np.random.default_rng(0)).numpy()
    assert slow.std((0, 1)) == pytest.approx(0.2 * 3, rel=0.25)
    assert np.abs(np.diff(slow, axis=1)).max() < 1e-12  # constant within a piece
    assert np.abs(np.diff(slow[:, 0], axis=0)[::2]).max() < 1e-12  # and within a recording of two


@pytest.mark.slow
def test_known_bad_sets_come_last_with_intervals_apart(task, arm):
    """On the LWR, with misfits and drift: what the study is for is to tell motions apart."""
    settings = task.cfg.worth
    few = {name: replace(one, count=4) for name, one in settings.tasks.items()}
    settings = replace(settings, tasks=few)
    limited = replace(arm, acceleration_limit=settings.acceleration * arm.velocity_limit)
    place = Constraints(limited, [Plane((0.0, 0.0, 1.0), 0.1)])
    judge, random = Judge(settings, TorqueModel(place.body, settings.model)), torch.Generator().manual_seed(0)
    moves = [m for one in few.values() for m in legs(place, one, settings.plant.rate, random)]
    seeds = [np.random.SeedSequence(k) for k in range(3)]
    made = {}
    for name in ("single", "tiny", "random_8", "condition", "chirp"):
        orders = (Order(place, None, settings, settings.contenders[name], 2, seed) for seed in seeds)
        made[name] = [make_set(one) for one in orders]
    last = {name: [] for name in made}
    for seed in seeds:
        plant = VariedPlant(place.arm, settings.plant, "eyring", seed)
        truth, regimes = judge.truth(plant, moves), {"drift": settings.regimes["drift"]}
        for name, ones in made.items():
            errors = judge.curves(plant, ones, truth, regimes, 0)["drift"].errors
            last[name].append(mean_error(errors)[:, -1].numpy())
    intervals = {name: estimate(np.stack(x), 300) for name, x in last.items()}
    bad = min(intervals[name].low for name in ("single", "tiny"))
    assert bad > max(one.high for name, one in intervals.items() if name not in ("single", "tiny"))


@pytest.fixture(scope="module")
def run(small, tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    run_stages(small.cfg, folder, "worth")
    return folder


def test_the_page_tells_the_goal_first_and_has_a_metric_for_every_contender(small, run):
    text = (run / "worth.md").read_text(encoding="utf-8")
    assert (run / "worth.html").exists() and (run / "worth" / "metrics.json").exists()
    first = text.split("\n\n")[1]
    found = page.collect(small)
    missed = [one for one in measures.goals(found) if not one.sure and one.against == measures.PRACTICE]
    assert ("misses its goal" in first) == bool(missed)
    numbers = measures.metrics(found)[small.arm.name]
    assert set(numbers) == set(contenders(small))
    assert set(numbers["tiny"]) == set(small.cfg.worth.regimes)


@pytest.mark.parametrize(
    ("seconds", "share", "met", "sure"),
    [
        ((20.0, 15.0, 25.0), (0.5, 0.4, 0.6), True, True),
        ((20.0, 15.0, 25.0), (0.5, 0.3, 0.9), True, False),  # by the median alone
        ((20.0, 15.0, np.inf), (0.0, 0.0, 1.0), True, False),  # the others never arrive, and ours not always
        ((20.0, 15.0, 25.0), (0.7, 0.4, 0.9), False, False),
        ((np.inf, 15.0, np.inf), (1.0, 1.0, 1.0), False, False),  # nobody arrives
    ],
)
def test_a_goal_is_met_where_its_whole_interval_is(seconds, share, met, sure):
    ours, others = Estimate(*seconds), Estimate(40.0, 30.0, 50.0)
    one = measures.Goal("arm", "drift", "practice", "a", "b", ours, others, Estimate(*share), 0.65)
    assert (one.met, one.sure) == (met, sure)


def test_what_was_made_is_not_made_again(small, run):
    name = next(iter(small.cfg.worth.contenders))
    made = sets(small, name), worth(small, 0)
    before = [small.store.require(one).stat().st_ino for one in made]
    run_stages(replace(small.cfg, stages=["worth"]), run, "again")
    assert [small.store.require(one).stat().st_ino for one in made] == before
    assert len(load(small, name)) == small.cfg.worth.sets


def test_a_contender_reports_how_long_its_sets_last(small, run):
    for name in contenders(small):
        seconds = [len(one.coefficients) * one.family.period for one in load(small, name)]
        assert small.report(sets(small, name))["seconds"] == pytest.approx(sum(seconds) / len(seconds))


def test_a_file_of_too_few_motions_is_refused_before_anything_is_made(task, tmp_path):
    path, points = tmp_path / "motions.json", [[0.0] * task.arm.joints] * 5
    path.write_text(json.dumps({"step": 2.0, "trajectories": [{"seconds": 1.0, "waypoints": points}]}))
    study = task.cfg.worth
    one = replace(
        study.contenders[study.estimated], maker="waypoints", period=8.0, files={task.arm.name: str(path)}
    )
    config = replace(task.cfg, worth=replace(study, contenders={**study.contenders, "theirs": one}))
    with pytest.raises(ConfigError, match="holds 1 motions, expected 2"):
        run_stages(config, tmp_path / "run", "few")
    assert not (tmp_path / "run" / "worth.md").exists()


def test_regimes_that_are_not_judged_are_artifacts_of_their_own(task):
    study = task.cfg.worth
    assert list(groups(task)) == ["", "others"]
    judged = {name: study.regimes[name] for name in study.judged}
    alone = task.with_settings(worth=replace(study, regimes=judged))
    assert list(groups(alone)) == [""]
    assert worth(alone, 0).digest == worth(task, 0).digest
    assert worth(task, 0, "others").digest != worth(task, 0).digest


def test_a_larger_study_goes_on_from_a_smaller_one(task):
    larger = task.with_settings(worth=replace(task.cfg.worth, plants=3, compared=2))
    assert plants(larger) == [(0, ""), (0, "others"), (1, ""), (1, "others"), (2, "")]
    assert worth(larger, 0).digest == worth(task, 0).digest


def test_an_arm_whose_description_is_missing_is_left_out(task):
    others = replace(task.cfg.worth, others={"gone": "/nowhere/arm.urdf"})
    assert list(arms(task.with_settings(worth=others))) == [task.arm.name]
