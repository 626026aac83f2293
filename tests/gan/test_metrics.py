import math

import numpy as np
import pytest

from sidegan.base.arrays import flatten
from sidegan.design.excitation import measure_excitation
from sidegan.design.fidelity import mean_distance
from sidegan.gan.metrics import measure_samples, random_set_errors


def test_seeds_are_valid_and_diverse(constraints, family, seeds):
    metrics = measure_samples(constraints, family, seeds, seeds)
    excitation = measure_excitation(constraints.body, family, seeds)
    assert metrics["success"] == 1
    assert metrics["condition"] == metrics["condition_valid"]
    assert metrics["condition"] == pytest.approx(np.median(excitation.eigenvalue_fitness))
    assert metrics["distance"] == pytest.approx(mean_distance(seeds), rel=0.1)
    assert 0 < metrics["nearest"] < metrics["distance"]
    assert 6 < metrics["rank"] <= 12 and abs(metrics["rank"] - metrics["rank_uncentred"]) < 0.5
    assert metrics["norm"] == pytest.approx(np.linalg.norm(flatten(seeds, 1), axis=1).mean())
    assert abs(metrics["cosine"]) < 0.05 and metrics["beyond"] == 0


def test_small_motions_are_detected(constraints, family, seeds):
    plain = measure_samples(constraints, family, 0.5 * seeds)
    small = measure_samples(constraints, family, 0.1 * seeds)
    assert small["success"] == 1 and small["error_constant"] > 10 * plain["error_constant"]
    assert plain["error_geometric"] < plain["error"]


def test_expected_errors_are_those_of_sets_of_35_valid_trajectories(constraints, family, seeds):
    few = random_set_errors(constraints, family, seeds[:34])
    assert list(few) == ["error", "error_geometric", "error_constant", "error_constant_geometric"]
    assert set(few.values()) == {math.inf}
    enough = random_set_errors(constraints, family, seeds[:36])
    assert all(map(math.isfinite, enough.values()))
    copies = random_set_errors(constraints, family, np.tile(seeds[:1], (60, 1, 1, 1)))
    assert copies["error_constant"] > 1.2 * enough["error_constant"]


def test_missing_metrics_are_nan(constraints, family, seeds):
    for count in (2, 3):
        metrics = measure_samples(constraints, family, seeds[:count])
        assert all(math.isfinite(x) for key, x in metrics.items() if "error" not in key)
    invalid = measure_samples(constraints, family, 20 * seeds[:20])
    assert invalid["success"] == 0
    assert math.isnan(invalid["condition_valid"]) and not math.isnan(invalid["condition"])
