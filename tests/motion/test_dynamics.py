"""Rigid-body dynamics: Pinocchio and a textbook as oracles, linearity in the parameters as the law."""

import math
from dataclasses import replace
from itertools import pairwise

import numpy as np
import pinocchio as pin
import pytest
import torch
from torch import Tensor

from sidegan.errors import RobotError, ShapeError
from sidegan.motion import newton_euler, plain
from sidegan.motion.base_parameters import BaseParameters
from sidegan.motion.compiled.chain import Chain
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm, pinocchio_model
from tests.chains import random_chain, random_states
from tests.threads import several_threads

CHAINS = [(joints, seed) for joints in range(1, 10) for seed in range(3)]


def from_pinocchio(model: pin.Model, q: Tensor, dq: Tensor, ddq: Tensor) -> tuple[np.ndarray, np.ndarray]:
    """Regressors (N, J, 10 J) and torques (N, J) of N states."""
    data = model.createData()
    states = list(zip(q.numpy(), dq.numpy(), ddq.numpy()))
    regressors = [pin.computeJointTorqueRegressor(model, data, *state).copy() for state in states]
    return np.stack(regressors).reshape(*q.shape, -1), np.stack(
        [pin.rnea(model, data, *state).copy() for state in states]
    )


def test_arm_agrees_with_pinocchio_on_10_000_states(arm: Arm) -> None:
    body, model = RigidBody(arm), pinocchio_model(arm)
    for part in range(4):  # 100 MB of regressors each
        states = random_states(arm, 2_500, seed=part)
        regressor, torque = from_pinocchio(model, *states)
        np.testing.assert_allclose(body.regressor(*states), regressor, atol=1e-10, rtol=0)
        np.testing.assert_allclose(body.torque(*states), torque, atol=1e-10, rtol=0)


@pytest.mark.parametrize(("joints", "seed"), CHAINS)
def test_any_chain_agrees_with_pinocchio(joints: int, seed: int) -> None:
    arm, model = random_chain(joints, seed)
    body, states = RigidBody(arm), random_states(arm, 40, seed)
    regressor, torque = from_pinocchio(model, *states)
    scale = np.abs(regressor).max()
    np.testing.assert_allclose(body.regressor(*states), regressor, atol=1e-13 * scale, rtol=0)
    np.testing.assert_allclose(body.torque(*states), torque, atol=1e-12 * scale, rtol=0)


def test_chains_cover_every_mixture_of_joints() -> None:
    kinds = [random_chain(*chain)[0].prismatic for chain in CHAINS]
    follows = {(bool(a), bool(b)) for kind in kinds for a, b in pairwise(kind)}
    assert len(follows) == 4 and {bool(kind[0]) for kind in kinds} == {False, True}


def test_planar_arm_has_the_textbooks_torque(planar: Arm) -> None:
    """Spong, Hutchinson and Vidyasagar, planar elbow arm; angles from the vertical, about +y."""
    q, dq, ddq = random_states(planar, 200)
    (m1, m2), (c1, c2), (i1, i2), l1, g = (3.0, 2.0), (0.18, 0.16), (0.045, 0.028), 0.4, 9.81
    cosine, sine = torch.cos(q[:, 1]), torch.sin(q[:, 1])
    d11 = m1 * c1**2 + m2 * (l1**2 + c2**2 + 2 * l1 * c2 * cosine) + i1 + i2
    d12 = m2 * (c2**2 + l1 * c2 * cosine) + i2
    d22 = m2 * c2**2 + i2
    h = m2 * l1 * c2 * sine
    lean = m2 * c2 * g * torch.sin(q.sum(1))
    first = d11 * ddq[:, 0] + d12 * ddq[:, 1] - h * (2 * dq[:, 0] + dq[:, 1]) * dq[:, 1]
    second = d12 * ddq[:, 0] + d22 * ddq[:, 1] + h * dq[:, 0] ** 2 - lean
    first = first - (m1 * c1 + m2 * l1) * g * torch.sin(q[:, 0]) - lean
    torque = RigidBody(planar).torque(q, dq, ddq)
    torch.testing.assert_close(torque, torch.stack([first, second], 1), atol=1e-12, rtol=0)


def test_torque_is_linear_in_the_parameters(arm: Arm) -> None:
    body, states = RigidBody(arm), random_states(arm, 60)
    generator = torch.Generator().manual_seed(1)
    one, two = torch.randn(2, 70, generator=generator, dtype=torch.float64)
    expected = 2 * body.torque(*states, one) - 3 * body.torque(*states, two)
    torch.testing.assert_close(body.torque(*states, (2 * one - 3 * two).reshape(7, 10)), expected)
    torch.testing.assert_close(body.torque(*states, one), body.regressor(*states) @ one)


def test_each_state_may_have_its_own_parameters(arm: Arm) -> None:
    body = RigidBody(arm)
    states = [x.reshape(4, 5, 7) for x in random_states(arm, 20)]
    own = torch.randn(4, 5, 70, dtype=torch.float64, generator=torch.Generator().manual_seed(2))
    expected = torch.einsum("btjk,btk->btj", body.regressor(*states), own)
    torch.testing.assert_close(body.torque(*states, own), expected)


@pytest.mark.parametrize(("joints", "seed"), [(1, 0), (4, 1), (7, 2)])
def test_torques_of_parameter_sets_are_regressor_times_set(joints: int, seed: int) -> None:
    arm, _ = random_chain(joints, seed)
    body = RigidBody(arm)
    states = [x.reshape(2, 6, joints) for x in random_states(arm, 12)]
    sets = torch.randn(2, 3, 10 * joints, dtype=torch.float64, generator=torch.Generator().manual_seed(3))
    expected = torch.einsum("btjn,bkn->bktj", body.regressor(*states), sets)
    torch.testing.assert_close(body.torques_of(*states, sets), expected)


def test_lwr_has_43_base_parameters(arm: Arm) -> None:
    assert RigidBody(arm).parameters_count == 43


def test_planar_arm_has_the_textbooks_base_parameters(planar: Arm) -> None:
    """Moments about each joint, and the second link's mass as if it sat at the elbow."""
    base = RigidBody(planar).base
    assert base.names == ("mx1", "mz1", "Iyy1", "mx2", "mz2", "Iyy2")
    m1, m2, l1 = 3.0, 2.0, 0.4
    values = [
        0.0,
        m1 * 0.18 + m2 * l1,
        0.045 + m1 * 0.18**2 + m2 * l1**2,
        0.0,
        m2 * 0.16,
        0.028 + m2 * 0.16**2,
    ]
    torch.testing.assert_close(base.values, torch.tensor(values, dtype=torch.float64), atol=1e-10, rtol=0)


@pytest.mark.parametrize("apart", [1e-2, 1e-3, 1e-4])
def test_what_moves_the_torque_ever_so_little_is_a_base_parameter(planar: Arm, apart: float) -> None:
    """Two parallel, upright axes, hardly apart: the second link's centre is felt through that alone."""
    upright = replace(planar, gravity=9.81 * planar.axis[0], translation=planar.translation * 0)
    assert RigidBody(upright).base.names == ("Iyy1", "Iyy2")
    shift = planar.translation * torch.tensor([[0.0], [1.0]], dtype=torch.float64)
    near = replace(upright, translation=apart * shift)
    assert RigidBody(near).base.names == ("Iyy1", "mx2", "mz2", "Iyy2")


@pytest.mark.parametrize("digits", [3, 4, 6])
def test_rounded_right_angles_add_no_base_parameter(planar: Arm, digits: int) -> None:
    """Upright but for what rounding leaves: weights that the tilt shows are no parameters of the joint."""
    upright = replace(planar, gravity=9.81 * planar.axis[0])
    exact = RigidBody(upright).base
    tilt = round(math.pi / 2, digits) - math.pi / 2
    turn = torch.tensor(
        [[1, 0, 0], [0, math.cos(tilt), -math.sin(tilt)], [0, math.sin(tilt), math.cos(tilt)]]
    ).double()
    for tilted in (
        replace(upright, gravity=turn @ upright.gravity),
        replace(upright, gravity=turn.T @ upright.gravity),
    ):
        base = RigidBody(tilted).base
        if digits == 3:  # a fifth of a millirad is no rounding: it is felt
            assert len(base.names) == len(exact.names) + 2
            continue
        assert base.names == exact.names
        torch.testing.assert_close(base.values, exact.values, rtol=1e-4, atol=1e-6)
        q, dq, ddq = random_states(tilted, 100, seed=1)
        torque = RigidBody(tilted).base_regressor(q, dq, ddq) @ base.values
        torch.testing.assert_close(torque, RigidBody(tilted).torque(q, dq, ddq), rtol=0, atol=2e-3)


@pytest.mark.parametrize(("joints", "seed"), [(0, 0), *CHAINS])
def test_base_parameters_explain_the_full_regressor(joints: int, seed: int, arm: Arm) -> None:
    arm = random_chain(joints, seed)[0] if joints else arm
    body, states = RigidBody(arm), random_states(arm, 300, seed=9)
    full, base = body.regressor(*states), body.base_regressor(*states)
    scale = float(full.abs().max())
    torch.testing.assert_close(base @ body.base.mapping, full, atol=1e-10 * scale, rtol=0)
    torch.testing.assert_close(base @ body.base.values, body.torque(*states), atol=1e-10 * scale, rtol=0)
    own = body.base.mapping[:, body.base.columns]
    torch.testing.assert_close(own, torch.eye(len(own), dtype=torch.float64))


@pytest.mark.parametrize(("joints", "seed"), [(0, 0), *CHAINS[3:]])
def test_base_columns_are_the_first_independent_ones(joints: int, seed: int, arm: Arm) -> None:
    arm = random_chain(joints, seed)[0] if joints else arm
    body = RigidBody(arm)
    full = body.regressor(*random_states(arm, 60, seed=8)).reshape(-1, 10 * arm.joints).numpy()
    kept: list[np.ndarray] = []
    columns = []
    for k, column in enumerate(full.T):  # Gram-Schmidt, twice
        if np.linalg.norm(column) < 1e-9 * np.linalg.norm(full, axis=0).max():
            continue
        rest = column / np.linalg.norm(column)
        for _ in range(2):
            for other in kept:
                rest = rest - other * (other @ rest)
        if np.linalg.norm(rest) > 1e-9:
            kept.append(rest / np.linalg.norm(rest))
            columns.append(k)
    assert body.base.columns.tolist() == columns


def test_base_parameters_are_the_same_every_time(arm: Arm) -> None:
    one, two = RigidBody(arm).base, RigidBody(arm).base
    assert one.names == two.names
    torch.testing.assert_close(one.mapping, two.mapping, atol=0, rtol=0)  # the same computation


def test_base_parameters_do_not_depend_on_the_threads_of_the_process(arm: Arm) -> None:
    one = BaseParameters.of(arm)
    with several_threads():
        other = BaseParameters.of(arm)
    for name in ("columns", "mapping", "values", "subspace"):
        assert torch.equal(getattr(one, name), getattr(other, name)), name  # the same computation


def test_an_arm_without_any_effect_is_refused(planar: Arm) -> None:
    with pytest.raises(RobotError, match="no inertial parameter of planar2"):
        _ = RigidBody(replace(planar, axis=torch.zeros(2, 3, dtype=torch.float64))).base


@pytest.mark.parametrize(("joints", "seed"), [(3, 0), (4, 1), (5, 2)])
def test_gradients_agree_with_finite_differences(joints: int, seed: int) -> None:
    arm, _ = random_chain(joints, seed)
    body = RigidBody(arm)
    states = tuple(x.requires_grad_(True) for x in random_states(arm, 2, seed))
    parameters = arm.inertial_parameters.clone().requires_grad_(True)
    assert torch.autograd.gradcheck(body.torque, (*states, parameters))
    assert torch.autograd.gradcheck(body.regressor, states, fast_mode=True)


def trajectories(arm: Arm, batch: int = 5) -> tuple[Trajectory, Tensor]:
    trajectory = Trajectory(arm.joints, 4, 8.0)
    c = torch.randn(batch, *trajectory.shape, generator=torch.Generator().manual_seed(4), dtype=torch.float64)
    return trajectory, 0.2 * c


def test_gram_is_the_mean_of_squared_regressors(arm: Arm) -> None:
    body = RigidBody(arm)
    trajectory, c = trajectories(arm)
    motion = trajectory.roll_out(c, trajectory.grid(30))
    y = body.base_regressor(*motion[1:])
    expected = torch.einsum("btjk,btjl->bkl", y, y) / 30
    torch.testing.assert_close(gram(body, trajectory, c, 30), expected, atol=1e-11, rtol=1e-11)


@pytest.mark.parametrize("states", [1, 7, 30, 45, 90])
def test_gram_does_not_depend_on_its_chunks(arm: Arm, states: int, monkeypatch: pytest.MonkeyPatch) -> None:
    body = RigidBody(arm)
    trajectory, c = trajectories(arm)
    whole = gram(body, trajectory, c, 30)
    sizes = []

    regressor = newton_euler.regressor

    def watched(chain: Chain, states: list[Tensor]) -> Tensor:
        sizes.append(states[0].shape[1])
        return regressor(chain, states)

    _ = body.base
    monkeypatch.setattr(plain, "_VALUES_AT_ONCE", states * 10 * 7**2)
    torch.testing.assert_close(gram(body, trajectory, c, 30), whole, atol=1e-11, rtol=1e-11)
    monkeypatch.setenv("SIDEGAN_KERNELS", "torch")
    monkeypatch.setattr(newton_euler, "regressor", watched)
    torch.testing.assert_close(gram(body, trajectory, c, 30), whole, atol=1e-11, rtol=1e-11)
    assert max(sizes) <= states and sum(sizes) == 5 * 30


def test_gram_of_no_trajectory_is_empty(arm: Arm) -> None:
    trajectory, c = trajectories(arm, batch=0)
    assert gram(RigidBody(arm), trajectory, c).shape == (0, 43, 43)


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_results_follow_type_and_device_of_the_states(
    arm: Arm, dtype: torch.dtype, device: torch.device
) -> None:
    body, states = RigidBody(arm), random_states(arm, 50)
    trajectory, c = trajectories(arm)
    there = [x.to(device, dtype) for x in states]
    pairs = [
        (body.regressor(*there), body.regressor(*states)),
        (body.base_regressor(*there), body.base_regressor(*states)),
        (body.torque(*there), body.torque(*states)),
        (gram(body, trajectory, c.to(device, dtype)), gram(body, trajectory, c)),
    ]
    for result, exact in pairs:
        assert result.dtype == dtype and result.device.type == device.type
        precision = 1e-5 if dtype == torch.float32 else 1e-12
        torch.testing.assert_close(
            result.cpu().double(), exact, rtol=0, atol=precision * float(exact.abs().max())
        )


@pytest.mark.parametrize("shape", [(), (7,), (3, 7), (2, 0, 7), (2, 3, 4, 7)])
def test_states_may_have_any_leading_shape(arm: Arm, shape: tuple[int, ...]) -> None:
    if shape == ():
        shape = (7,)
    body = RigidBody(arm)
    q = torch.zeros(shape, dtype=torch.float64)
    assert body.regressor(q, q, q).shape == (*shape, 70)
    assert body.base_regressor(q, q, q).shape == (*shape, 43)
    assert body.torque(q, q, q).shape == shape


@pytest.mark.parametrize("bad", [0, 1, 2])
@pytest.mark.parametrize("shape", [(4, 6), (5, 7), (7,), ()])
def test_states_of_the_wrong_shape_are_refused(arm: Arm, bad: int, shape: tuple[int, ...]) -> None:
    states = [torch.zeros(4, 7)] * 3
    states[bad] = torch.zeros(shape)
    for use in (RigidBody(arm).regressor, RigidBody(arm).torque):
        with pytest.raises(ShapeError, match="expected"):
            use(*states)


@pytest.mark.parametrize("shape", [(6, 10), (69,), (4, 70), (3, 1, 70)])
def test_parameters_of_the_wrong_shape_are_refused(arm: Arm, shape: tuple[int, ...]) -> None:
    q = torch.zeros(3, 7)
    with pytest.raises(ShapeError, match=r"expected \(7, 10\), \(70,\) or \(3, 70\)"):
        RigidBody(arm).torque(q, q, q, torch.zeros(shape))


def test_trajectories_of_another_arm_are_refused(arm: Arm, planar: Arm) -> None:
    trajectory, c = trajectories(arm)
    with pytest.raises(ShapeError, match=r"expected \(…, 2\)"):
        gram(RigidBody(planar), trajectory, c)
    with pytest.raises(ShapeError, match="at least one sample, got 0"):
        gram(RigidBody(arm), trajectory, c, samples=0)
