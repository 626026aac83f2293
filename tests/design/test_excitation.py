"""Excitation and diversity: the full YᵀY and closed forms as oracles."""

import math
import subprocess
import sys

import numpy as np
import pytest
import torch
from torch import Tensor

from sidegan.design import excitation
from sidegan.design.excitation import Excitation, effective_rank, excite, mean_distance, nearest_distance
from sidegan.errors import ShapeError
from sidegan.motion.dynamics import BaseParameters, RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import Arm
from tests.chains import random_chain


def trajectories(joints: int, batch: int = 6) -> tuple[Trajectory, Tensor]:
    trajectory = Trajectory(joints, 4, 8.0)
    c = torch.randn(batch, *trajectory.shape, generator=torch.Generator().manual_seed(5), dtype=torch.float64)
    return trajectory, 0.3 * c


def full_gram(body: RigidBody, trajectory: Trajectory, c: Tensor, samples: int = 80) -> Tensor:
    motion = trajectory.roll_out(c, trajectory.grid(samples))
    y = body.regressor(*motion[1:]).flatten(1, 2)
    return y.transpose(1, 2) @ y / samples


@pytest.mark.parametrize("joints", [0, 1, 2, 4])
def test_spectrum_is_that_of_the_full_regressor(joints: int, arm: Arm) -> None:
    arm = random_chain(joints, 0)[0] if joints else arm
    body, (trajectory, c) = RigidBody(arm), trajectories(arm.joints)
    excitation = excite(body, trajectory, c)
    eigenvalues = torch.linalg.eigvalsh(full_gram(body, trajectory, c))
    p = body.parameters_count
    noise = 1e-13 * eigenvalues[:, -1:]
    assert (eigenvalues[:, :-p].abs() <= noise).all()
    assert ((excitation.spectrum - eigenvalues[:, -p:]).abs() <= noise + 1e-9 * eigenvalues[:, -p:]).all()


def test_trace_and_diagonal_are_those_of_the_full_regressor(arm: Arm) -> None:
    body, (trajectory, c) = RigidBody(arm), trajectories(7)
    excitation, diagonal = (
        excite(body, trajectory, c),
        full_gram(body, trajectory, c).diagonal(dim1=1, dim2=2),
    )
    torch.testing.assert_close(excitation.spectrum.sum(1), diagonal.sum(1))
    torch.testing.assert_close(excitation.diagonal, diagonal[:, body.base.columns])


def with_other_columns(arm: Arm) -> RigidBody:
    """The arm with the last independent columns of the regressor as its base instead of the first."""
    body = RigidBody(arm)
    mapping = body.base.mapping.numpy()
    kept: list[int] = []
    for k in reversed(range(mapping.shape[1])):
        if np.linalg.matrix_rank(mapping[:, [*kept, k]], tol=1e-6) > len(kept):
            kept.append(k)
    other = torch.from_numpy(np.linalg.solve(mapping[:, kept], mapping))
    body.base = BaseParameters(
        columns=torch.tensor(kept),
        mapping=other,
        values=other @ arm.inertial_parameters.flatten(),
        subspace=torch.linalg.cholesky(other @ other.T),
        names=("",) * len(kept),
    )
    return body


def test_spectrum_does_not_depend_on_the_columns_picked(arm: Arm) -> None:
    trajectory, c = trajectories(7)
    one, two = (excite(body, trajectory, c) for body in (RigidBody(arm), with_other_columns(arm)))
    torch.testing.assert_close(one.spectrum, two.spectrum, rtol=1e-9, atol=1e-13 * float(one.spectrum.max()))
    assert (one.diagonal_fitness / two.diagonal_fitness - 1).abs().max() > 0.1


def test_fitnesses_are_ratios_of_extremes() -> None:
    spectrum = torch.tensor([[2.0, 3.0, 8.0], [1e-9, 1.0, 1.0]], dtype=torch.float64)
    diagonal = torch.tensor([[5.0, 1.0, 2.0], [7.0, 3.5, 7.0]], dtype=torch.float64)
    excitation = Excitation(spectrum, diagonal)
    torch.testing.assert_close(excitation.eigenvalue_fitness, torch.tensor([4.0, 1e9], dtype=torch.float64))
    assert excitation.diagonal_fitness.tolist() == [5.0, 2.0]
    torch.testing.assert_close(
        excitation.spectrum.sum(1), torch.tensor([13.0, 2.0 + 1e-9], dtype=torch.float64)
    )


@pytest.mark.parametrize("low", [0.0, -1e-18, 4e-16])
def test_fitness_of_an_unexcited_direction_is_infinite(low: float) -> None:
    spectrum = torch.tensor([[low, 0.5, 1.0]], dtype=torch.float64)
    assert Excitation(spectrum, spectrum).eigenvalue_fitness.item() == math.inf


def test_an_arm_at_rest_excites_nothing_but_gravity(arm: Arm) -> None:
    trajectory = Trajectory(7)
    excitation = excite(RigidBody(arm), trajectory, torch.zeros(1, *trajectory.shape, dtype=torch.float64))
    assert excitation.eigenvalue_fitness.item() == excitation.diagonal_fitness.item() == math.inf
    assert excitation.spectrum.sum(1).item() > 0


@pytest.mark.parametrize("dtype", [torch.float32, torch.float64])
def test_excitation_follows_type_and_device(planar: Arm, dtype: torch.dtype, device: torch.device) -> None:
    body, (trajectory, c) = RigidBody(planar), trajectories(2)
    exact, there = excite(body, trajectory, c), excite(body, trajectory, c.to(device, dtype))
    for name in ("spectrum", "diagonal", "eigenvalue_fitness", "diagonal_fitness"):
        result = getattr(there, name)
        assert result.dtype == dtype and result.device.type == device.type
        torch.testing.assert_close(result.cpu().double(), getattr(exact, name), rtol=1e-2, atol=1e-4)


def test_bad_coefficients_are_refused(planar: Arm) -> None:
    body, (trajectory, c) = RigidBody(planar), trajectories(2)
    with pytest.raises(ShapeError, match="coefficients are"):
        excite(body, trajectory, c[0])
    c[3, 0, 0, 0] = torch.nan
    with pytest.raises(ShapeError, match="trajectory 3 are not finite"):
        excite(body, trajectory, c)
    seven, of_seven = trajectories(7)
    with pytest.raises(ShapeError, match=r"expected \(…, 2\)"):
        excite(body, seven, of_seven)


def test_distances_of_a_rectangle() -> None:
    corners = torch.tensor([[0, 0], [3, 0], [0, 4], [3, 4]], dtype=torch.float64)
    assert mean_distance(corners) == pytest.approx((2 * 3 + 2 * 4 + 2 * 5) / 6)
    assert nearest_distance(corners) == pytest.approx(3.0)


def test_distances_of_a_simplex() -> None:
    corners = torch.eye(12, dtype=torch.float64).reshape(12, 2, 3, 2)
    assert mean_distance(corners) == pytest.approx(math.sqrt(2))
    assert nearest_distance(corners) == pytest.approx(math.sqrt(2))


def test_far_apart_modes_have_a_mean_distance_but_no_nearest_one() -> None:
    modes = torch.tensor([[0.0], [10.0]], dtype=torch.float64).repeat(5, 1)
    assert mean_distance(modes) == pytest.approx(10 * 25 / 45)
    assert nearest_distance(modes) == 0.0
    assert effective_rank(modes) == pytest.approx(1.0)


def test_effective_rank_counts_equal_directions() -> None:
    for d in (1, 2, 7):
        axes = torch.cat([torch.eye(9, dtype=torch.float64)[:d], -torch.eye(9, dtype=torch.float64)[:d]])
        assert effective_rank(axes + 100.0) == pytest.approx(d)


def test_effective_rank_of_unequal_directions_is_exp_of_the_entropy() -> None:
    steps = torch.diag(torch.tensor([3.0, 1.0], dtype=torch.float64).sqrt())
    entropy = -(0.75 * math.log(0.75) + 0.25 * math.log(0.25))
    assert effective_rank(torch.cat([steps, -steps])) == pytest.approx(math.exp(entropy))


def test_effective_rank_of_copies_is_zero() -> None:
    row = torch.randn(84, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    assert effective_rank(row.repeat(101, 1)) == 0.0
    assert effective_rank(torch.zeros(3, 4)) == 0.0


def test_effective_rank_does_not_depend_on_scale_or_basis() -> None:
    generator = torch.Generator().manual_seed(0)
    x = torch.randn(200, 6, generator=generator, dtype=torch.float64) * torch.arange(1, 7)
    turn = torch.linalg.qr(torch.randn(6, 6, generator=generator, dtype=torch.float64))[0]
    assert effective_rank(1e-7 * x @ turn - 5.0) == pytest.approx(effective_rank(x), rel=1e-6)


def test_a_single_trajectory_has_nothing_to_differ_from() -> None:
    one = torch.zeros(1, 2, 3, 2, dtype=torch.float64)
    assert excitation.diversity(one, Excitation(torch.ones(1, 5), torch.ones(1, 8))) == {}


@pytest.mark.parametrize("measure", [mean_distance, nearest_distance, effective_rank])
def test_a_single_row_has_no_diversity(measure) -> None:
    with pytest.raises(ShapeError, match="at least 2 rows, got 1"):
        measure(torch.zeros(1, 7, 6, 2))


def _nearest_of_all(x: torch.Tensor) -> float:
    """All distances at once, as it was before large sets."""
    rows = x.reshape(len(x), -1)
    distances = torch.cdist(rows, rows, compute_mode="donot_use_mm_for_euclid_dist")
    return float(distances.fill_diagonal_(torch.inf).amin(1).mean())


def _rows(count: int) -> torch.Tensor:
    return torch.randn(count, 2, 3, 2, dtype=torch.float64, generator=torch.Generator().manual_seed(count))


@pytest.mark.parametrize("count", [2, 7, 933])
@pytest.mark.parametrize("held", [1, 3000, 25_000_000])
def test_blocks_change_no_bit_of_the_nearest_distance(count, held, monkeypatch) -> None:
    monkeypatch.setattr(excitation, "_DISTANCES", held)
    assert nearest_distance(_rows(count)).hex() == _nearest_of_all(_rows(count)).hex()


def test_a_sample_of_a_large_set_tells_nearly_the_same(monkeypatch) -> None:
    x = _rows(3000)
    exact = nearest_distance(x), mean_distance(x)
    monkeypatch.setattr(excitation, "_EXACT", 2999)
    monkeypatch.setattr(excitation, "_PAIRED", 1000)
    assert (nearest_distance(x), mean_distance(x)) == pytest.approx(exact, rel=0.03)
    assert nearest_distance(x) != exact[0]


def test_two_hundred_thousand_trajectories_take_no_more_than_their_share_of_memory() -> None:
    script = (
        "import re, torch\n"
        "from pathlib import Path\n"
        "from sidegan.design.excitation import nearest_distance\n"
        # Of this program alone: ru_maxrss begins with the peak of the process that started it.
        "def peak(): return int(re.search(r'VmHWM:\\s+(\\d+)', Path('/proc/self/status').read_text())[1])\n"
        "x = torch.rand(200_000, 2)\n"
        "before = peak()\n"
        "nearest_distance(x)\n"
        "print((peak() - before) / 1024)\n"
    )
    megabytes = subprocess.run([sys.executable, "-c", script], capture_output=True, check=True).stdout
    assert 0 < float(megabytes) < 600
