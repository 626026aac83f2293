"""Which capsules can leave which regions, by the regions' own margins."""

import numpy as np
import torch

from sidegan.kernels.guards import leaving
from sidegan.motion.arrays import shapes_of
from sidegan.validity.constraints import random_axes
from sidegan.validity.regions import tables
from tests.motion.conftest import REGIONS


def test_a_capsule_leaves_what_its_margin_says(arm):
    """In each of some configurations alone, so that one of them cannot hide another."""
    none = torch.zeros(0, 2, dtype=torch.long)
    shapes = shapes_of(arm.capsules, none, none, tables(list(REGIONS.values())))
    moving = torch.nonzero(arm.capsules.link >= 0)[:, 0]
    axes = torch.stack(random_axes(arm))[:, :, moving, :100]  # (2, 3, C, N)
    clear = (
        torch.stack([region.margin(*axes) for region in REGIONS.values()]) > arm.capsules.radius[moving, None]
    )
    ends = np.ascontiguousarray(axes.permute(0, 2, 3, 1))
    alone = [leaving(shapes, moving.numpy(), ends[:, :, n : n + 1].copy()) for n in range(100)]
    np.testing.assert_array_equal(np.stack(alone, 2), clear)
    assert (clear.sum((1, 2)) > 50).all() and ((~clear).sum((1, 2)) > 50).all()
    np.testing.assert_array_equal(leaving(shapes, moving.numpy(), ends), clear.any(2))
