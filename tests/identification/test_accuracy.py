"""What estimates say about their own errors, against the errors that are made."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.signal import butter, sosfiltfilt

from sidegan.base.arrays import split
from sidegan.identification import estimate
from sidegan.identification.accuracy import inflation_of
from sidegan.robot import load_robot
from tests.identification.recordings import Fixed, model_of, multisine, truth_of, white


def low_passed(noise):
    """Noise after the zero-phase filter that recordings go through: 5 Hz at 100 Hz."""
    return sosfiltfilt(butter(4, 0.1, output="sos"), noise, axis=0)


class TestStatedDeviations:
    @pytest.mark.parametrize(
        ("name", "method", "samples", "colour", "error"),
        [
            *(("planar2", method, 300, np.copy, 0.12) for method in ("weighted", "ols")),
            ("kuka_lwr4", "weighted", 600, np.copy, 0.05),
            ("planar2", "weighted", 2000, low_passed, 0.12),
        ],
    )
    def test_hold(self, name, method, samples, colour, error):
        model, found = model_of(load_robot(name)), []
        y, truth = model.regressor(*multisine(model.joints, samples, seed=4)), truth_of(model)
        fixed, level = Fixed(y), np.linspace(2.0, 0.2, model.joints)
        for k in range(50):
            noise = colour(white((samples, model.joints), k, 7))
            one = estimate(method, fixed, fixed.measurements(y @ truth + level * noise))
            found.append((one.parameters - truth) / one.deviation)
        assert (np.abs(found) <= 3).mean() >= 0.99
        assert np.std(found) == pytest.approx(1.0, abs=error)


class TestCorrelation:
    @pytest.mark.parametrize("phi", [0.0, 0.5, 0.9])
    def test_of_an_autoregressive_process(self, phi):
        random = np.random.default_rng(1)
        r = np.zeros((20_000, 2))
        for t in range(1, len(r)):
            r[t] = phi * r[t - 1] + random.normal(size=2)
        inflation = inflation_of(split(r, 4096))
        assert inflation.tolist() == pytest.approx([(1 + phi) / (1 - phi)] * 2, rel=0.2)

    @settings(max_examples=30, deadline=None)
    @given(st.integers(1, 60), st.integers(0, 99))
    def test_is_at_least_one_for_anything(self, samples, seed):
        r = np.random.default_rng(seed).normal(size=(samples, 3))
        r[:, 2] = 0  # a residual of nothing correlates with nothing
        inflation = inflation_of([r, r[:1]])
        assert (inflation >= 1).all() and np.isfinite(inflation).all()
