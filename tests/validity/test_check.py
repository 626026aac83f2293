"""The check of whole trajectories: what dense sampling finds, it finds; what is comfortable, it accepts."""

import sys
from functools import cache

import pytest
import torch
from torch import Tensor

from sidegan.motion.compiled import VARIABLE
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from sidegan.validity import Constraints, Plane, check
from tests.chains import random_chain

from .critical import BENT, BOX, DESK, KINDS, drawn, isolated, margins_at, named, scaled_to, smallest

COARSE = 20.0  # [Hz] centres and edges of the check's first cells
DENSE = 2_000.0  # [Hz]
TINY = {"position": 1e-5, "velocity": 1e-5, "torque": 1e-4, "collision": 1e-6, "desk": 1e-6, "box": 1e-6}
TINY |= {"acceleration": 1e-5, "jerk": 1e-4}
COMFORTABLE = {"position": 1e-3, "velocity": 5e-3, "acceleration": 1e-2, "jerk": 1e-1, "torque": 1.0}
COMFORTABLE |= {"collision": 1e-3, "desk": 1e-3, "box": 1e-3}


def family(arm: Arm, period: float = 3.0) -> Trajectory:
    return Trajectory(arm.joints, 5, period, BENT if arm.joints == 7 else None)


@pytest.fixture(params=["arm", "planar"])
def any_arm(request: pytest.FixtureRequest) -> Arm:
    return request.getfixturevalue(request.param)


@pytest.mark.parametrize("kind", KINDS)
def test_what_is_bad_only_between_coarse_samples_is_caught(kind: str, any_arm: Arm) -> None:
    constraints, trajectory, name = isolated(any_arm, kind), family(any_arm), named(kind)

    def coarse(c: Tensor) -> Tensor:
        return smallest(constraints, trajectory, c, COARSE)[name]

    c = scaled_to(coarse, drawn(trajectory, 24), target=1e-9)
    bad = smallest(constraints, trajectory, c, DENSE)[name] < 0
    assert (coarse(c) >= 0).all() and bad.sum() >= 10
    validity = check(constraints, trajectory, c)
    assert not validity.valid[bad].any()
    for i in torch.nonzero(bad)[:, 0].tolist():
        assert [failure.constraint for failure in validity.failures(i)] == [name]


@pytest.mark.parametrize("kind", KINDS)
def test_a_tiny_violation_is_caught_and_a_comfortable_margin_accepted(kind: str, any_arm: Arm) -> None:
    constraints, trajectory, name = isolated(any_arm, kind), family(any_arm), named(kind)

    def dense(c: Tensor) -> Tensor:
        return smallest(constraints, trajectory, c, 200.0)[name]

    c = drawn(trajectory, 8, seed=1)
    bad = scaled_to(dense, c, target=-TINY[kind]) * (1 + 1e-9)
    good = scaled_to(dense, c, target=COMFORTABLE[kind])
    good = good[smallest(constraints, trajectory, good, DENSE)[name] > 0.9 * COMFORTABLE[kind]]
    assert len(bad) >= 5 and not check(constraints, trajectory, bad).valid.any()
    validity = check(constraints, trajectory, good)
    assert len(good) >= 5 and validity.valid.all(), validity.margins


@cache
def near_the_limits(arm: Arm) -> tuple[Constraints, Trajectory, Tensor, Tensor]:
    """Trajectories around their tightest limit, and the smallest of each one's dense margins."""
    constraints, trajectory = Constraints(arm, [DESK]), family(arm, period=4.0)
    count = 100 if arm.joints == 2 else 40

    def coarse(c: Tensor) -> Tensor:
        share = [
            x / scale
            for x, scale in zip(smallest(constraints, trajectory, c, 20.0).values(), (1, 1, 40, 1, 1))
        ]
        return torch.stack(share).amin(0)

    c = scaled_to(coarse, drawn(trajectory, count, seed=2), target=1e-4)
    generator = torch.Generator().manual_seed(3)
    c = c * torch.empty(len(c), 1, 1, 1, dtype=c.dtype).uniform_(0.98, 1.02, generator=generator)
    dense = torch.stack(list(smallest(constraints, trajectory, c, DENSE).values())).amin(0)
    return constraints, trajectory, c, dense


@pytest.mark.parametrize("kernels", ["numba", "torch"])
def test_valid_means_that_dense_sampling_finds_nothing(
    any_arm: Arm, kernels: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv(VARIABLE, kernels)
    constraints, trajectory, c, dense = near_the_limits(any_arm)
    validity = check(constraints, trajectory, c)
    assert 0.1 < validity.valid.double().mean() < 0.9
    assert (dense[validity.valid] >= 0).all()
    # Nor is it timid: what it refuses is bad, or all but.
    assert (dense[~validity.valid] < 1e-3).all()


@pytest.mark.parametrize("seed", range(4))
def test_valid_holds_for_chains_with_prismatic_joints(seed: int) -> None:
    arm, _ = random_chain(4, seed)
    constraints = Constraints(arm, [Plane((0.0, 0.6, 0.8), -0.6)])
    trajectory = Trajectory(4, 4, 3.0, ((arm.position_lower + arm.position_upper) / 2).tolist())

    def coarse(c: Tensor) -> Tensor:
        margins = margins_at(constraints, trajectory, c, trajectory.times(20.0))
        return torch.stack([m.amin(1) for name, m in margins.items() if name != "torque"]).amin(0)

    c = scaled_to(coarse, drawn(trajectory, 40, seed), target=1e-3)
    c = torch.cat([c, 0.97 * c])
    dense = torch.stack(list(smallest(constraints, trajectory, c, DENSE).values())).amin(0)
    valid = check(constraints, trajectory, c).valid
    assert (dense[valid] >= 0).all() and (dense[~valid] < 2e-3).all()


@pytest.mark.parametrize(("constraint", "harmonic", "phase"), [("position", 0, 1), ("velocity", 2, 0)])
def test_failure_says_what_where_when_and_by_how_much(
    constraint: str, harmonic: int, phase: int, planar: Arm
) -> None:
    constraints, trajectory = Constraints(planar), Trajectory(2, 3, 6.0)
    c = torch.zeros(1, *trajectory.shape, dtype=torch.float64)
    c[0, 1, harmonic, phase] = 1.0
    bad = scaled_to(lambda c: smallest(constraints, trajectory, c, 1000.0)[constraint], c, -0.05, most=9.0)
    validity = check(constraints, trajectory, torch.cat([c / 2, bad]))
    assert validity.valid.tolist() == [True, False] and validity.failures(0) == []
    failure = {failure.constraint: failure for failure in validity.failures(1)}[constraint]
    assert failure.where == "elbow" and failure.margin == pytest.approx(-0.05, abs=0.01)
    motion = trajectory.roll_out(bad, torch.tensor([failure.time], dtype=torch.float64))
    assert float(constraints.margins(*(x[0] for x in motion[1:]))[constraint].min()) == pytest.approx(
        failure.margin
    )
    assert str(failure) == f"{constraint} of elbow at {failure.time:.3f} s: margin {failure.margin:.4g}"


def test_failure_names_the_pair_and_the_region(planar: Arm) -> None:
    constraints, trajectory = Constraints(planar, [DESK]), Trajectory(2, 1, 6.0)
    shoulder, elbow = torch.zeros(2, 1, *trajectory.shape, dtype=torch.float64)
    shoulder[0, 0, 0, 1] = elbow[0, 1, 0, 1] = 1.0
    for swing, name, where in (
        (shoulder, "keep_out", "forearm in region 0"),
        (elbow, "collision", "base – forearm"),
    ):
        c = scaled_to(
            lambda c, name=name: smallest(constraints, trajectory, c, 100.0)[name], swing, target=-0.01
        )
        failures = {
            failure.constraint: failure.where for failure in check(constraints, trajectory, c).failures(0)
        }
        assert failures[name] == where


def test_margins_are_the_smallest_sampled(arm: Arm) -> None:
    constraints, trajectory = Constraints(arm, [DESK]), Trajectory(7, home=BENT)
    c = 0.01 * drawn(trajectory, 5)
    validity, dense = check(constraints, trajectory, c), smallest(constraints, trajectory, c, 500.0)
    assert validity.valid.all() and set(validity.margins) == set(dense) == set(constraints.labels)
    for name, margin in validity.margins.items():
        torch.testing.assert_close(margin, dense[name], rtol=0.02, atol=2e-3)
        at = margins_at(constraints, trajectory, c, validity.times[name])[name].diagonal()
        torch.testing.assert_close(margin, at)


def test_result_depends_neither_on_the_batch_nor_on_the_chunks(
    arm: Arm, monkeypatch: pytest.MonkeyPatch
) -> None:
    constraints, trajectory = Constraints(arm, [DESK]), family(arm)
    c = 0.12 * drawn(trajectory, 12)
    whole = check(constraints, trajectory, c)
    assert 0 < whole.valid.sum() < 12
    single = [check(constraints, trajectory, one[None]) for one in c]
    monkeypatch.setattr(sys.modules["sidegan.validity.search"], "_STATES_AT_ONCE", 37)
    monkeypatch.setattr(sys.modules["sidegan.validity.check"], "_CELLS_AT_ONCE", 70)
    chunked = check(constraints, trajectory, c)
    clear = torch.stack(list(whole.margins.values())).abs().amin(0) > 1e-9  # elsewhere rounding decides
    assert clear.sum() > 6
    assert torch.equal(whole.valid[clear], chunked.valid[clear])
    assert torch.equal(whole.valid[clear], torch.cat([v.valid for v in single])[clear])
    for name, margin in whole.margins.items():
        torch.testing.assert_close(chunked.margins[name], margin)
        torch.testing.assert_close(torch.cat([v.margins[name] for v in single]), margin)


def test_a_state_on_the_limit_is_not_called_valid(planar: Arm) -> None:
    """Its margin is zero, but no sample can show that it stays so."""
    trajectory = Trajectory(2, 2, 3.0, home=(2.6, 0.0))
    c = torch.zeros(1, *trajectory.shape, dtype=torch.float64)
    c[0, 0, 0, 1] = -0.1
    validity = check(Constraints(planar), trajectory, torch.cat([c, -c]))
    assert not validity.valid.any()
    assert all(validity.failures(i)[0].where == "shoulder" for i in range(2))


@pytest.mark.parametrize("period", [0.01, 0.13, 560.0])
def test_any_period_can_be_checked(planar: Arm, period: float) -> None:
    trajectory = Trajectory(2, 6, period)
    c = drawn(trajectory, 2)
    peak = trajectory.roll_out(c, trajectory.times(2000 / period))
    fast = (peak.velocity.abs() / planar.velocity_limit).amax((1, 2))
    far = (peak.position.abs() / planar.position_upper).amax((1, 2))
    c = c / torch.maximum(fast, far)[:, None, None, None]
    constraints = Constraints(planar, torque=False)
    assert not check(constraints, trajectory, 1.001 * c).valid.any()
    assert check(constraints, trajectory, 0.3 * c).valid.all()


def test_single_precision_is_checked_in_double(arm: Arm, device: torch.device) -> None:
    constraints, trajectory = Constraints(arm, [DESK]), Trajectory(7, home=BENT)
    c = 0.05 * drawn(trajectory, 10).float()
    single, double = check(constraints, trajectory, c.to(device)), check(constraints, trajectory, c.double())
    clear = torch.stack(list(double.margins.values())).abs().amin(0) > 1e-9
    assert clear.any() and torch.equal(single.valid.cpu()[clear], double.valid[clear])
    for name, margin in single.margins.items():
        assert margin.dtype == torch.float64 and margin.device.type == device.type
        torch.testing.assert_close(margin.cpu(), double.margins[name])


def test_no_trajectory_at_all_and_absurd_ones(planar: Arm) -> None:
    constraints, trajectory = Constraints(planar, [DESK, BOX]), Trajectory(2)
    validity = check(constraints, trajectory, torch.zeros(0, *trajectory.shape))
    assert validity.valid.shape == (0,) and all(m.shape == (0,) for m in validity.margins.values())
    for size in (1e3, 1e150, 1e200, 1e300):
        c = torch.full((2, *trajectory.shape), size, dtype=torch.float64)
        c[1, :, ::2] *= -1
        validity = check(constraints, trajectory, c)
        assert not validity.valid.any() and validity.failures(0)
