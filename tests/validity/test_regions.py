"""Keep-out regions: closed forms and brute force."""

import math

import numpy as np
import pytest
import torch
from torch import Tensor

from sidegan.errors import ConfigError
from sidegan.validity import Box, Convex, Plane, Region, Sphere

BALL, ROD = Sphere((0.1, -0.2, 0.3), 0.3), Convex.between((-0.2, 0.1, 0.0), (0.3, -0.2, 0.4), 0.2)
BOX = Box((-0.3, -0.2, 0.1), (0.5, 0.4, 0.3))


def random_segments(count: int, seed: int = 0) -> tuple[Tensor, Tensor]:
    generator = torch.Generator().manual_seed(seed)
    return (0.6 * torch.randn(2, 3, count, generator=generator, dtype=torch.float64)).unbind()


def from_box(point: np.ndarray) -> float:
    """Signed distance [m] of a point to BOX, face by face."""
    lower, upper = np.array(BOX.lower), np.array(BOX.upper)
    if ((point > lower) & (point < upper)).all():
        return -float(min((point - lower).min(), (upper - point).min()))
    return float(np.linalg.norm(point - np.clip(point, lower, upper)))


def test_plane_measures_the_lower_end() -> None:
    plane = Plane((0.0, 3.0, 4.0), 2.0)  # the normal becomes (0, 0.6, 0.8)
    a, b = torch.tensor([[1.0, 5.0, 0.0]]).T, torch.tensor([[1.0, 0.0, 5.0]]).T
    assert plane.margin(a, b).tolist() == pytest.approx([0.6 * 5 - 2])
    a, b = random_segments(100)
    along = torch.stack(
        [torch.tensor(plane.unit, dtype=torch.float64) @ x - 2.0 for x in (a, (a + b) / 2, b)]
    )
    torch.testing.assert_close(plane.margin(a, b), along.amin(0))


def test_box_margin_is_the_least_along_the_segment() -> None:
    a, b = random_segments(300)
    shares = torch.linspace(0, 1, 201, dtype=torch.float64)
    margin = BOX.margin(a, b).numpy()
    for n in range(300):
        brute = min(from_box(torch.lerp(a[:, n], b[:, n], s).numpy()) for s in shares)
        length = float((a[:, n] - b[:, n]).norm())
        assert brute - length / 400 <= margin[n] <= brute + 1e-8
    assert (margin < 0).sum() > 30 and (margin > 0).sum() > 100


def test_box_margin_of_known_segments() -> None:
    cases = {
        ((1.0, 0.0, 0.2), (2.0, 0.0, 0.2)): 0.5,  # beside the box
        ((-1.0, 0.0, 0.2), (2.0, 0.0, 0.2)): -0.1,  # through its middle, where top and bottom are nearest
        ((0.8, 0.8, 0.2), (0.8, 0.8, 0.2)): 0.5,  # a point that sees an edge
        ((0.1, 0.1, 0.7), (0.1, 0.1, 0.3)): 0.0,  # from above, down to the lid
        ((0.8, 0.0, 0.6), (0.2, 0.0, 0.6)): 0.3,  # over the lid
    }
    for (a, b), expected in cases.items():
        margin = BOX.margin(*(torch.tensor([x], dtype=torch.float64).T for x in (a, b)))
        assert margin.item() == pytest.approx(expected, abs=1e-8)


@pytest.mark.parametrize("region", [BOX, Plane((0.3, -1.0, 2.0), 0.4), BALL, ROD])
def test_gradients_agree_with_finite_differences(region: Region) -> None:
    a, b = (x.clone().requires_grad_(True) for x in random_segments(40, seed=3))
    assert torch.autograd.gradcheck(region.margin, (a, b))


@pytest.mark.parametrize("region", [BOX, Plane((0.3, -1.0, 2.0), 0.4), BALL, ROD])
def test_margins_follow_type_and_device(region: Region, device: torch.device) -> None:
    a, b = random_segments(50)
    margin = region.margin(a.to(device, torch.float32), b.to(device, torch.float32))
    assert margin.dtype == torch.float32 and margin.device.type == device.type
    torch.testing.assert_close(margin.cpu().double(), region.margin(a, b), atol=1e-6, rtol=0)


@pytest.mark.parametrize(
    ("normal", "offset"),
    [
        ((0.0, 0.0, 0.0), 0.1),
        ((0.0, 1.0), 0.1),
        ((0.0, 0.0, 0.0, 1.0), 0.1),
        ((0.0, math.nan, 1.0), 0.1),
        ((0.0, 0.0, 1.0), math.inf),
    ],
)
def test_impossible_planes_are_refused(normal: tuple, offset: float) -> None:
    with pytest.raises(ConfigError, match="non-zero normal of three numbers and an offset, got Plane"):
        Plane(normal, offset)


@pytest.mark.parametrize(
    ("lower", "upper"),
    [
        ((0.0, 0.0, 0.0), (1.0, 1.0, 0.0)),
        ((0.0, 2.0, 0.0), (1.0, 1.0, 1.0)),
        ((0.0, 0.0), (1.0, 1.0)),
        ((0.0, 0.0, 0.0), (1.0, 1.0)),
        ((0.0, 0.0, -math.inf), (1.0, 1.0, 1.0)),
        ((0.0, 0.0, math.nan), (1.0, 1.0, 1.0)),
    ],
)
def test_impossible_boxes_are_refused(lower: tuple, upper: tuple) -> None:
    with pytest.raises(ConfigError, match="three coordinates in lower, all below those in upper, got Box"):
        Box(lower, upper)
