"""Design for the error on tasks: its gradient is exact, its parts are what simulated least squares shows."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import yaml

from sidegan.base.typed import build
from sidegan.design.prediction import LACKING, Misfits, Prediction, Volume
from sidegan.design.sequence import Search, designed, together, told, value_and_gradient
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.identification import Terms, TorqueModel
from sidegan.identification.model import states_within
from sidegan.pipeline.run import CONF
from sidegan.validity import check

TERMS = Terms(True, True, True, True, False, 0.03)
SEARCH = Search(starts=4, rough=5, strict=15, samples=4, reserve=0.03)


@pytest.fixture(scope="module")
def misfits():
    values = yaml.safe_load((CONF / "worth" / "_base.yaml").read_text(encoding="utf-8"))["misfits"]
    return build(Misfits, values)


@pytest.fixture(scope="module")
def made(planar_problem, misfits):
    def make(kind=Prediction, sizes=misfits):
        model = TorqueModel(planar_problem.body, TERMS)
        tasks = states_within(planar_problem.constraints.arm, 200, seed=5)
        scale = torch.tensor([20.0, 5.0], dtype=torch.float64)
        return kind(model, tasks, scale, sizes, 1e-3 * torch.eye(model.count, dtype=torch.float64))

    return make


@pytest.mark.parametrize("kind", [Prediction, Volume])
@pytest.mark.parametrize("known", [0, 2])
def test_the_gradient_is_that_of_finite_differences(planar_problem, made, random, kind, known):
    aim = made(kind)
    for c in planar_problem.start(known, random):
        aim.take(told(planar_problem, aim, c[None], 60))
    c = planar_problem.start(3, random)
    _, gradient = value_and_gradient(planar_problem, aim, c, 30)
    way, step = torch.randn(c.shape, generator=random, dtype=torch.float64), 1e-6
    ends = (value_and_gradient(planar_problem, aim, c + s * step * way, 30)[0] for s in (1, -1))
    slope = (next(ends) - next(ends)) / (2 * step)
    torch.testing.assert_close((gradient * way).sum((1, 2, 3)), slope, rtol=1e-5, atol=1e-6)


def test_the_bias_is_that_of_weighted_least_squares_on_the_misfit(planar_problem, made, misfits, random):
    """Torques of one misfit alone are identified, and judged on the tasks, sample by sample."""
    none = dict.fromkeys(LACKING, 0.0)
    aim = made(sizes=replace(misfits, **none | {"stribeck": 0.3}))
    c = planar_problem.start(2, random)
    for one in c:
        aim.take(told(planar_problem, aim, one[None], 100))
    states = [
        x.flatten(0, 1)
        for x in planar_problem.trajectory.roll_out(c, planar_problem.trajectory.grid(100))[1:]
    ]
    rows = aim.rows(*states)
    size, weight = 0.3 * misfits.friction * aim.scale, aim.per_second.sqrt() * (8.0 / 100) ** 0.5
    total = 0.0
    tasks = aim.rows(*states_within(planar_problem.constraints.arm, 200, seed=5))
    relative = tasks.regressor / aim.scale[:, None] / (200 * 2) ** 0.5
    for joint in range(2):  # the misfits of the joints are independent
        b = torch.zeros_like(rows.lasting[:, :, 0])
        b[:, joint] = size[joint] * rows.lasting[:, joint, 0]
        y = torch.cat(
            [(rows.regressor * weight[:, None]).flatten(0, 1), 1e-3**0.5 * torch.eye(aim.model.count)]
        )
        right = torch.cat([(b * weight).flatten(), torch.zeros(aim.model.count, dtype=torch.float64)])
        found = torch.linalg.lstsq(y, right).solution
        lack = torch.zeros_like(tasks.lasting[:, :, 0])
        lack[:, joint] = size[joint] * tasks.lasting[:, joint, 0]
        target = lack / aim.scale / (200 * 2) ** 0.5
        best = torch.linalg.lstsq(relative.flatten(0, 1), target.flatten()).solution
        errors = [(target - relative @ x).square().sum() for x in (found, best)]
        total += float(errors[0] - errors[1])
    assert aim.parts()[1] == pytest.approx(total, rel=1e-4)


def test_the_variance_is_that_of_drawn_noise(planar_problem, made, misfits, random):
    aim = made(sizes=replace(misfits, **dict.fromkeys(LACKING, 0.0)))
    c = planar_problem.start(3, random)
    for one in c:
        aim.take(told(planar_problem, aim, one[None], 60))
    covariance = torch.linalg.inv(aim.known.information)
    draws = torch.randn(4000, len(covariance), generator=random, dtype=torch.float64)
    errors = draws @ torch.linalg.cholesky(covariance).T
    seen = torch.einsum("np,pq,nq->n", errors, aim.tasks, errors)
    assert aim.parts()[0] == pytest.approx(float(seen.mean()), rel=0.1)
    assert aim.parts()[1:] == pytest.approx((0.0, 0.0), abs=1e-15)


@pytest.mark.parametrize("times", [1e-3, 1e3])
def test_the_unit_of_the_torque_does_not_matter(planar_problem, made, misfits, random, times):
    """But for friction that follows the torque itself."""
    usual, c = made(sizes=replace(misfits, load=0.0)), planar_problem.start(1, random)
    tasks = states_within(planar_problem.constraints.arm, 200, seed=5)
    belief = usual.known.information / times**2
    other = Prediction(usual.model, tasks, times * usual.scale, usual.misfits, belief)
    for aim in (usual, other):
        aim.take(told(planar_problem, aim, c, 60))
    assert min(usual.parts()) > 0
    assert other.parts() == pytest.approx(usual.parts(), rel=1e-6)


def test_drift_counts_for_each_recording_anew(planar_problem, made, misfits, random):
    """Twice the same motion halves what drifts between recordings; it does not touch the lasting bias."""
    sizes = replace(misfits, **dict.fromkeys(LACKING, 0.0) | {"drift": 0.2})
    aim, c = made(sizes=sizes), planar_problem.start(1, random)
    parts = []
    for _ in range(2):
        aim.take(told(planar_problem, aim, c, 60))
        parts.append(aim.parts()[2])
    assert parts[1] == pytest.approx(parts[0] / 2, rel=0.05)


def test_a_designed_set_is_valid_and_predicts_better_than_random_ones(planar_problem, made, random):
    problem, c = designed([planar_problem], made(), 3, SEARCH, random)
    assert c.shape == (3, *problem.trajectory.shape)
    assert check(problem.constraints, problem.trajectory, c).valid.all()
    errors = []
    for some in (c, planar_problem.start(3, random, 0.5)):
        aim = made()
        for one in some:
            aim.take(told(problem, aim, one[None], 100))
        errors.append(sum(aim.parts()))
    assert errors[0] < 0.7 * errors[1]


@pytest.mark.parametrize("harmonics", [3, 6])
def test_the_search_sees_every_harmonic_however_few_samples_are_asked_for(
    planar_problem, made, random, harmonics
):
    """Two cell centres for each harmonic would not see the highest cosine, which vanishes at them all."""
    seen = set()

    class Seen(Prediction):
        def told(self, q, *rest):
            seen.add(q.shape[1])
            return super().told(q, *rest)

    family = replace(planar_problem.trajectory, harmonics=harmonics, period=2.0)
    slow = replace(planar_problem, trajectory=family, samples=2 * harmonics + 1)
    designed([slow], made(Seen), 1, replace(SEARCH, samples=1, rough=1, strict=1), random)
    assert min(seen) > 2 * harmonics


def test_sets_that_are_designed_at_once_are_those_that_are_designed_alone(planar_problem, made, random):
    """For tasks and knowledge of their own, one after another."""

    def aims():
        both = made(), made()
        both[1].take(told(planar_problem, both[1], planar_problem.start(1, seeded(9)), 60))
        both[1].root = both[1].root[:, :-1] * 2  # tasks of their own, which tell of less
        return both

    def seeded(seed):
        return torch.Generator().manual_seed(seed)

    at_once = together(planar_problem, aims(), 2, SEARCH, [seeded(0), seeded(1)])
    for k, one in enumerate(at_once):
        (alone,) = together(planar_problem, [aims()[k]], 2, SEARCH, [seeded(k)])
        torch.testing.assert_close(one, alone, rtol=1e-4, atol=1e-6)
    assert (at_once[0] - at_once[1]).abs().max() > 0.01


def test_the_period_is_the_one_that_lowers_the_error_most_in_a_second(planar_problem, made, random):
    slow = replace(planar_problem, trajectory=replace(planar_problem.trajectory, period=200.0))
    problem, _ = designed([slow, planar_problem], made(), 1, SEARCH, random)
    assert problem is planar_problem


def test_what_cannot_be_is_refused(planar_problem, made, random):
    aim = made()
    with pytest.raises(ShapeError, match="expected one"):
        aim.take(told(planar_problem, aim, planar_problem.start(2, random), 30))
    hopeless = replace(SEARCH, rough=1, strict=1, starts=1)
    arm = replace(planar_problem.constraints.arm, torque_limit=torch.full((2,), 1e-3, dtype=torch.float64))
    tight = replace(planar_problem, constraints=type(planar_problem.constraints)(arm, [], True))
    with pytest.raises(InfeasibleError, match="outside the constraints"):
        hopeless.one(tight, aim, random)


def test_misfits_scale_with_the_joints_torque(misfits):
    scale = torch.tensor([1.0, 10.0], dtype=torch.float64)
    lasting, passing = misfits.amplitudes(scale)
    torch.testing.assert_close(lasting[1], 100 * lasting[0])
    torch.testing.assert_close(passing[1], 100 * passing[0])
    assert np.all(lasting.numpy() > 0)
