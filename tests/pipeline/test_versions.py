"""Numbers that follow from fixed trajectories: where one moves, its maker's version must have been raised.

Makers that search or train are not watched, since where a search ends differs from one processor to another;
picks are goldens.
"""

import numpy as np
import pytest

from sidegan.library.measure import measured
from sidegan.pipeline.context import EXPECTED, FACTS, RESULTS
from sidegan.pipeline.stages.baselines import random_set
from sidegan.pipeline.stages.identification import identification
from sidegan.pipeline.stages.replication import replication, sums
from sidegan.pipeline.stages.selection import ExcitationSet, whole_sets
from tests.golden.make import draw

RECORDED = {
    "identification": {
        "expected/nmse": 0.000104937134,
        "results/nmse": 5.44514199e-06,
        "facts/covariance_norm": 0.00094240276,
        "facts/condition": 621.553249,
        "facts/samples": 3864.0,
    },
    "replication": {
        "results/nmse": 6.9134697e-05,
        "facts/covariance_norm": 0.000440682567,
        "facts/samples": 14683.2,
    },
}
COLUMNS = ("nmse", "covariance_norm", "condition", "samples")


@pytest.fixture
def fixed(context, monkeypatch):
    """A context whose seeds and libraries are the same 24 trajectories on every machine."""
    made = context("gan=eigen", experiment="reproduction")
    c = draw(1, 24, 2, 3, 2) / np.array([1.0, 2.0, 3.0])[:, None]
    library = measured(made.cell.constraints, made.cell.trajectory, c, "fixed")
    monkeypatch.setattr(type(made), "load", lambda self, *artifacts: library)
    return made


def means(context, artifact, files):
    """Means of an artifact's numbers over weightings, joints, noise and tests."""
    context.store.produce(artifact)
    tables = {file.partition(".")[0]: context.frame(artifact, file) for file in files}
    return {
        f"{name}/{key}": table[key].mean()
        for name, table in tables.items()
        for key in COLUMNS
        if key in table
    }


def identified(context):
    excitation = ExcitationSet("fixed", None, context.cell.trajectory, random_set(context))
    return means(context, identification(context, excitation), (EXPECTED, RESULTS, FACTS))


def replicated(context):
    for pool in whole_sets(context):
        context.store.produce(sums(context, pool, "all"))
    return means(context, replication(context, "all"), (RESULTS, FACTS))


WATCHED = {"identification": identified, "replication": replicated}


@pytest.mark.parametrize("makers", WATCHED)
def test_results_change_only_with_their_makers_version(fixed, makers):
    found, recorded = WATCHED[makers](fixed), RECORDED[makers]
    assert list(found) == list(recorded)
    for key, x in found.items():
        remedy = f"{key} of {makers} is {x!r}: raise its version in params.yaml, and record it here anew"
        assert x == pytest.approx(recorded[key], rel=1e-6), remedy
