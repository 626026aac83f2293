"""The planar arm with nothing around it, a set of trajectories for it, and seeds."""

import pytest

import sidegan as sg

FREE = {"workspace": {"desk": None}, "harmonics": 3}
SEARCH = {"evaluations": 60, "patience": 60}
SEEDS = {"steps": 20, "samples": 20, "batch": 20}


@pytest.fixture(scope="package")
def cell():
    return sg.Cell("planar2", period=8, **FREE)


@pytest.fixture(scope="package")
def excitation(cell):
    return sg.excite(cell, count=3, seed=0, search=SEARCH)


@pytest.fixture(scope="package")
def seeds(cell):
    return sg.seeds(cell, 60, settings=SEEDS, workers=1)
