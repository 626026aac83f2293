"""Seeds by optimisers, and their finished parts."""

import numpy as np

import sidegan as sg
from tests.steps.conftest import FREE, SEEDS


def test_finished_parts_serve_the_same_call_alone(cell, tmp_path):
    def made(count=20, seed=0, cell=cell):
        return sg.seeds(cell, count, seed, settings=SEEDS, folder=tmp_path, workers=1)

    first = made()
    assert np.array_equal(made(seed=np.int64(0)).coefficients, first.coefficients)
    assert len([*tmp_path.iterdir()]) == 1
    assert not np.array_equal(made(seed=1).coefficients, first.coefficients)
    weak = sg.Cell("planar2", period=8, effort=0.4, **FREE)
    assert len(made(count=8)) == 8 and made(cell=weak).valid.all()


def test_the_papers_optimiser_needs_no_further_settings(cell):
    less = {"method": "paper", "steps": 1, "ants": 20, "evaluations": 50}
    made = sg.seeds(cell, 2, settings=less, workers=1)
    assert made.valid.all() and np.abs(made.coefficients).max() <= 0.2 * (1 + 1e-6)
