import pytest
import torch

from sidegan.errors import ShapeError
from sidegan.identification import covariance_norm, nmse

TORQUE = torch.tensor([[1.0, 10.0], [3.0, 10.0], [5.0, 40.0]], dtype=torch.float64)


def test_by_hand():
    # Errors 0, 1, 1 and 3, 0, 0: mean squares 2/3 and 3; variances 8/3 and 200.
    predicted = TORQUE + torch.tensor([[0.0, 3.0], [1.0, 0.0], [-1.0, 0.0]])
    assert nmse(TORQUE, predicted).tolist() == pytest.approx([0.25, 0.015])


def test_a_perfect_model_has_zero_and_the_mean_has_one():
    assert nmse(TORQUE, TORQUE).tolist() == [0, 0]
    assert nmse(TORQUE, TORQUE.mean(0).expand(3, 2)).tolist() == pytest.approx([1, 1])


def test_units_and_offsets_do_not_matter():
    random = torch.Generator().manual_seed(0)
    torque, error = torch.randn(2, 50, 3, generator=random, dtype=torch.float64)
    scaled = nmse(torque * 1e-6 + 2e-5, (torque + error) * 1e-6 + 2e-5)
    torch.testing.assert_close(scaled, nmse(torque, torque + error), rtol=1e-8, atol=0)


@pytest.mark.parametrize("rounding", [0.0, 1e-15])
def test_a_constant_joint_is_named(rounding):
    torque = TORQUE.clone()
    torque[:, 0] = 3.0 + rounding * torch.tensor([0.0, 1.0, 2.0])
    with pytest.raises(ShapeError, match=r"joints \[1\] is constant"):
        nmse(torque, TORQUE)


@pytest.mark.parametrize("shape", [(3, 1), (2, 2), (6,)])
def test_shapes_must_agree(shape):
    with pytest.raises(ShapeError, match=r"\(S, J\)"):
        nmse(TORQUE, torch.zeros(shape))


def test_no_samples_and_what_is_not_finite_are_refused():
    with pytest.raises(ShapeError, match=r"\(S, J\)"):
        nmse(TORQUE[:0], TORQUE[:0])
    with pytest.raises(ShapeError, match="finite"):
        nmse(TORQUE, TORQUE * torch.nan)


def test_covariance_norm_by_hand():
    assert covariance_norm(torch.tensor([[3.0, 100.0], [100.0, 4.0]])) == 5.0
    with pytest.raises(ShapeError, match=r"\(p, p\)"):
        covariance_norm(torch.ones(2, 3))
