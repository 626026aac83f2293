"""A straight way that is called free is free at every point; one that is refused is not."""

import pytest
import torch
from hypothesis import given, settings
from hypothesis import strategies as st

from sidegan.errors import InfeasibleError, ShapeError
from sidegan.validity import Constraints, Plane
from sidegan.validity.straight import require_straight

DENSE = 2001


def least(constraints, start, end):
    """Smallest margin on a dense grid along the way."""
    share = torch.linspace(0, 1, DENSE, dtype=torch.float64)[:, None]
    margins = constraints.at_rest(torch.lerp(start, end, share))
    return min(float(x.min()) for x in margins.values() if x.numel())


@settings(max_examples=60)
@given(seed=st.integers(0, 10**6), reach=st.floats(0.1, 1.0))
def test_the_verdict_is_that_of_a_dense_grid(arm, seed, reach):
    desk = Constraints(arm, [Plane(normal=(0, 0, 1), offset=0.1)], torque=False)
    generator = torch.Generator().manual_seed(seed)
    share = torch.rand(2, arm.joints, generator=generator, dtype=torch.float64) - 0.5
    middle, half = (arm.position_upper + arm.position_lower) / 2, arm.position_upper - arm.position_lower
    start, end = middle + reach * share * half
    found = least(desk, start, end)
    try:
        require_straight(desk, start.tolist(), end.tolist())
    except InfeasibleError as error:
        assert found < 1e-3 and "along it" in str(error)
    else:
        assert found >= 0


def test_what_is_in_the_way_is_named_and_where(planar):
    wall = Constraints(planar, [Plane(normal=(1, 0, 0), offset=-0.5)])
    with pytest.raises(InfeasibleError, match=r"keep_out of .*, \d+% along it"):
        require_straight(wall, [0.0, 0.0], [-2.0, 0.0])
    with pytest.raises(InfeasibleError, match="position of shoulder"):
        require_straight(wall, [0.0, 0.0], [3.0, 0.0])


@pytest.mark.parametrize("start", [[0.0], [float("nan"), 0.0]])
def test_other_ends_are_refused(planar, start):
    with pytest.raises(ShapeError, match="2 finite joint positions"):
        require_straight(Constraints(planar), start, [0.0, 0.0])
