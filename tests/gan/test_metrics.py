import math

import pytest
import torch

from sidegan.design.excitation import excite
from sidegan.gan.metrics import measure


def test_seeds_are_valid_and_diverse(constraints, family, seeds):
    metrics = measure(constraints, family, seeds)
    excitation = excite(constraints.body, family, seeds)
    assert metrics["success"] == 1
    assert metrics["condition"] == metrics["condition_valid"]
    assert metrics["condition"] == pytest.approx(float(excitation.eigenvalue_fitness.median()))
    everything = torch.pdist(seeds.flatten(1)).mean()
    assert metrics["distance"] == pytest.approx(float(everything), rel=0.1)
    assert 0 < metrics["nearest"] < metrics["distance"]
    assert 6 < metrics["rank"] <= 12


def test_what_is_not_there_is_not_a_number(constraints, family, seeds):
    for count in (2, 3):
        assert all(map(math.isfinite, measure(constraints, family, seeds[:count]).values()))
    invalid = measure(constraints, family, 20 * seeds[:20])
    assert invalid["success"] == 0
    assert math.isnan(invalid["condition_valid"]) and not math.isnan(invalid["condition"])
