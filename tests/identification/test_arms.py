import numpy as np
import pytest
import torch

from sidegan.errors import SideganError
from sidegan.identification import Noise, Rls, covariance_norm, evaluate, identify, identify_weighted, measure
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory, concatenate
from sidegan.robot import load_robot

CLEAN = Noise(level=0.0)


@pytest.fixture(scope="module", params=["planar2", "kuka_lwr4"])
def arm_body(request):
    return RigidBody(load_robot(request.param))


def motions(body, count, seed, scale=0.5):
    """Random trajectories of 8 s at 50 Hz."""
    trajectory = Trajectory(body.joints, period=8.0)
    random = torch.Generator().manual_seed(seed)
    c = torch.randn(count, *trajectory.shape, generator=random, dtype=torch.float64) * scale
    return trajectory.roll_out(c, trajectory.times(50.0))


def measured(body, motion, noise, seed=0):
    return measure(body, motion, noise, np.random.default_rng(seed))


def test_noise_free_measurements_give_the_arms_base_parameters(arm_body):
    data = measured(arm_body, motions(arm_body, 10, seed=1), CLEAN)
    unseen = measured(arm_body, motions(arm_body, 5, seed=2), CLEAN)
    for method in (identify, identify_weighted):
        found = method(arm_body, data, prior=1e12)
        torch.testing.assert_close(found.parameters, arm_body.base.values, rtol=0, atol=1e-8)
        assert evaluate(arm_body, found, unseen).max() < 1e-14


def test_it_is_least_squares_of_the_stacked_regressor(arm_body):
    data = measured(arm_body, motions(arm_body, 10, seed=1), Noise())
    rows = arm_body.base_regressor(*data.states).flatten(0, 1)
    prior = 1e-3 * torch.eye(rows.shape[1], dtype=torch.float64)
    right = torch.cat([data.torque.flatten(), torch.zeros(len(prior), dtype=torch.float64)])
    expected = torch.linalg.lstsq(torch.cat([rows, prior]), right).solution
    found = identify(arm_body, data, prior=1e6, samples_at_once=333)
    torch.testing.assert_close(found.parameters, expected, rtol=0, atol=1e-9 * float(expected.abs().max()))


def test_noise_on_torque_is_averaged_out(arm_body):
    data = measured(arm_body, motions(arm_body, 10, seed=1), Noise())
    unseen = measured(arm_body, motions(arm_body, 5, seed=2), CLEAN)
    plain = evaluate(arm_body, identify(arm_body, data), unseen)
    weighted = evaluate(arm_body, identify_weighted(arm_body, data), unseen)
    assert weighted.max() < 1e-3
    assert weighted.mean() <= plain.mean() * 1.5


def test_the_large_joints_drown_the_wrist_unless_weighted():
    body = RigidBody(load_robot("kuka_lwr4"))
    data = measured(body, motions(body, 10, seed=1), Noise())
    unseen = measured(body, motions(body, 5, seed=2), CLEAN)
    plain = evaluate(body, identify(body, data), unseen)
    weighted = evaluate(body, identify_weighted(body, data), unseen)
    assert plain.argmax() == 6 and weighted.mean() < 1e-2 * plain.mean()


def test_a_crawl_identifies_worse_than_lively_motion(arm_body):
    unseen = measured(arm_body, motions(arm_body, 5, seed=2), CLEAN)

    def result(scale):
        data = measured(arm_body, motions(arm_body, 10, seed=1, scale=scale), Noise("additive"))
        found = identify(arm_body, data)
        return evaluate(arm_body, found, unseen).mean(), covariance_norm(found.covariance)

    lively, crawl = result(0.5), result(0.02)
    assert lively[0] < crawl[0] and lively[1] < crawl[1]


def test_trajectories_in_sequence_are_one_long_motion(arm_body):
    motion = motions(arm_body, 6, seed=3)
    apart = identify(arm_body, measured(arm_body, motion, CLEAN))
    joined = identify(arm_body, measured(arm_body, concatenate(motion), CLEAN))
    assert joined.samples == apart.samples - 5  # the shared sample at rest is counted once
    assert covariance_norm(joined.covariance) == pytest.approx(covariance_norm(apart.covariance), rel=0.02)


def test_a_replica_of_the_data_halves_the_covariance(arm_body):
    data = measured(arm_body, motions(arm_body, 10, seed=1), CLEAN)
    once, twice = (identify(arm_body, [data] * n, prior=1e15) for n in (1, 2))
    assert covariance_norm(twice.covariance) == pytest.approx(covariance_norm(once.covariance) / 2, rel=1e-6)


def test_an_arm_at_rest_is_predicted_where_it_rests(arm_body):
    motion = motions(arm_body, 1, seed=1, scale=0.0)
    data = measured(arm_body, motion, CLEAN)
    found = identify(arm_body, data)
    assert found.parameters.isfinite().all() and found.covariance.isfinite().all()
    predicted = arm_body.base_regressor(*data.states) @ found.parameters
    torch.testing.assert_close(predicted, data.torque, rtol=0, atol=1e-5)


def test_a_motion_of_another_arm_is_refused(arm_body):
    trajectory = Trajectory(arm_body.joints + 1)
    motion = trajectory.roll_out(
        torch.zeros(1, *trajectory.shape, dtype=torch.float64), trajectory.times(10.0)
    )
    with pytest.raises(SideganError, match=f"expected .*{arm_body.joints}"):
        measured(arm_body, motion, CLEAN)


def test_forgetting_follows_a_change_of_load():
    body = RigidBody(load_robot("planar2"))
    motion = motions(body, 4, seed=1)
    states = [x.flatten(0, 1) for x in motion[1:]]
    heavier = 1.5 * body.base.values
    regressor = body.base_regressor(*states)
    half = len(regressor) // 2
    torque = torch.cat([regressor[:half] @ body.base.values, regressor[half:] @ heavier])
    rls = Rls(len(heavier), body.joints, forgetting=0.98)
    rls.update(regressor, torque)
    torch.testing.assert_close(rls.estimate, heavier, rtol=0, atol=1e-4)
