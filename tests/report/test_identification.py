"""The report of an identification: everything is shown, escaped, offline."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidegan.report.identification import Origin, page, plots
from sidegan.report.identification.page import correlation_of, report_html
from tests.report.builders import identification
from tests.report.pages import Page

HOSTILE = '<script>alert("x")</script>&'
ORIGIN = Origin(f"sidegan.run identify {HOSTILE}", HOSTILE, {"model": {"method": "x", HOSTILE: HOSTILE}})
FILES = {"the verdict": "verdict.json", HOSTILE: f'"{HOSTILE}'}


@pytest.fixture(scope="module")
def identified(planar):
    """An arm whose names, and those of its recordings, are not to be trusted."""
    names = {"name": f"planar2{HOSTILE}", "joint_names": (f"shoulder{HOSTILE}", "$elbow")}
    arm = replace(planar, **names, link_names=(HOSTILE, "forearm"))
    return identification(arm, f"a.csv{HOSTILE}", f"b.csv{HOSTILE}")


@pytest.fixture(scope="module")
def html(identified):
    return report_html(identified, ORIGIN, FILES)


@pytest.fixture(scope="module")
def read(html):
    return Page(html)


def test_everything_is_told(identified, read):
    verdict = f"{identified.trust.verdict}: mean nMSE"
    for words in (
        "Identification of planar2", verdict, *identified.trust.reasons, "Use the consistent model",
        "1 gap", "750 samples", "shoulder", "elbow", identified.model.formulas[0],
        "forearm", "nMSE, validation", "verdict.json", "method: x", "sidegan.run identify",
    ):  # fmt: skip
        assert words in read.text, words
    order = (verdict, "1 gap", "750 samples", "stands for")
    places = [read.text.index(words) for words in order]  # warnings come before what is fine
    assert places == sorted(places)


def test_every_plot_is_drawn_with_its_words(read):
    names = ("errors", "torques-1", "torques-2", "whiteness", "correlation", "friction")
    assert [name for name in read.ids if name.startswith("plot-")] == [f"plot-{name}" for name in names]
    assert read.tags.count("svg") == len(names)
    for words in ("measured", "identified", "lag [s], b.csv", "velocity [rad/s]", "$elbow [N·m]"):
        assert words in read.text, words


def test_nothing_comes_from_elsewhere(html, read):
    assert all(link.startswith("#") or link in FILES.values() for link in read.links)
    assert {link[1:] for link in read.links if link.startswith("#")} <= set(read.ids)
    assert len(read.ids) == len(set(read.ids))
    assert "default-src 'none'" in html and "<script" not in html and "script-src" not in html
    assert len(html) < 1e6


def test_words_from_outside_run_nothing(html, read):
    assert HOSTILE not in html and HOSTILE in read.text


def test_what_there_is_nothing_to_say_of_is_left_out(identified, monkeypatch):
    monkeypatch.setattr(plots, "_RECORDINGS", 1)
    pulled = replace(identified.trust, other_gravity="gravity is another one")
    text = Page(report_html(replace(identified, trust=pulled, tests=identified.trained), ORIGIN, {})).text
    assert "nMSE, validation" not in text
    assert "1 more recordings are not shown" in text and "Use none of these models" in text


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=400), st.integers(2, 40))
def test_thinning_keeps_extremes(values, most):
    x = np.array(values)
    kept = plots.thinned(x, most)
    assert len(kept) <= max(most, 2)
    assert (np.diff(kept) > 0).all()
    assert x[kept].max() == x.max() and x[kept].min() == x.min()


def test_thinning_keeps_where_a_line_breaks():
    x = np.ones(10_000)
    x[5000] = np.nan
    assert 5000 in plots.thinned(x, 100)


def test_autocorrelation_of_a_wave_of_noise_and_of_nothing():
    wave = plots.autocorrelation(np.sin(np.arange(20_000) * 2 * np.pi / 40))
    np.testing.assert_allclose(wave, np.cos(np.arange(61) * 2 * np.pi / 40), atol=5e-3)
    noise = plots.autocorrelation(np.random.default_rng(0).normal(size=40_000))
    assert noise[0] == 1 and np.abs(noise[1:]).max() < 0.02
    assert plots.autocorrelation(np.zeros(5)).tolist() == [1, 0, 0, 0, 0]


def test_correlation_of_a_covariance():
    half = np.random.default_rng(0).normal(size=(4, 4))
    covariance = half @ half.T
    deviation = np.sqrt(np.diag(covariance))
    found = correlation_of(covariance)
    np.testing.assert_allclose(found * deviation * deviation[:, None], covariance, atol=1e-12)
    assert correlation_of(np.zeros((2, 2))).tolist() == [[1, 0], [0, 1]]


def test_only_pairs_that_go_together_are_named():
    correlation = np.array([[1, -0.9, 0.2], [-0.9, 1, 0.85], [0.2, 0.85, 1]])
    first, second = page.hard_to_tell_apart(correlation, "abc")
    assert first.startswith("a and b (-0.9): their sum")
    assert second.startswith("b and c (0.85): their difference")
    assert page.hard_to_tell_apart(np.eye(3), "abc") == []
    assert page.hard_to_tell_apart(np.ones((5, 5)), "abcde")[-1] == "and 2 more pairs"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.23456, "1.235"), (-2.5e-7, "-2.5e-7"), (1.5e12, "1.5e12"), (-3e-17, "0"), (np.nan, "—"),
        (np.inf, "—"), (0.0, "0"),
    ],
)  # fmt: skip
def test_numbers_for_people(value, text):
    assert page.number(value) == text


def test_shares_for_people():
    shares = [0.008, 0.12, 33.3, float("inf")]
    assert [page.percent(x) for x in shares] == ["0.8 %", "12 %", "> 1000 %", "—"]
