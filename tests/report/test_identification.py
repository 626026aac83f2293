"""The report of an identification: everything is shown, escaped, offline."""

from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
from hypothesis import given
from hypothesis import strategies as st

from sidegan.report.identification import page, plots
from sidegan.report.identification.content import Finding, Friction, Signals, correlation_of
from sidegan.report.identification.page import report_html, write_report
from tests.report.builders import PARAMETERS, bare, identification, signals
from tests.report.pages import Page

HOSTILE = '<script>alert("x")</script>&'


@pytest.fixture(scope="module")
def report():
    return identification()


@pytest.fixture(scope="module")
def html(report):
    return report_html(report)


@pytest.fixture(scope="module")
def read(html):
    return Page(html)


def test_everything_is_told(read):
    for words in (
        "Identification of planar2", "The model can be trusted.", "It predicts what was held out.", "0.0042",
        "Use the consistent model.", "1.26",
        "Run trajectory 12.", "a gap of 1 s", "shoulder", "elbow", "Izz1 + 0.16 m2", "3·10⁻⁵", "123", "0.8 %",
        "> 1000 %", "upper", "1.4", "verdict.json", "method: weighted", "python -m sidegan.pipeline.run",
        "Marked: 1 whose uncertainty matters", "mx2 and fv1 (0.95): their difference",
    ):  # fmt: skip
        assert words in read.text, words
    order = ("The model can be trusted.", "Run trajectory 12.", "a gap of 1 s", "300 samples", "Izz1")
    places = [read.text.index(words) for words in order]  # warnings come before what is fine
    assert places == sorted(places)


def test_every_plot_is_drawn_with_its_words(read):
    names = ("errors", "torques-1", "torques-2", "whiteness", "correlation", "friction")
    assert [name for name in read.ids if name.startswith("plot-")] == [f"plot-{name}" for name in names]
    assert read.tags.count("svg") == len(names)
    for words in ("measured", "identified", "lag [s], b.csv", "velocity [rad/s]", "shoulder [N·m]"):
        assert words in read.text, words


def test_nothing_comes_from_elsewhere(html, read):
    assert all(link.startswith("#") or link == "verdict.json" for link in read.links)
    assert {link[1:] for link in read.links if link.startswith("#")} <= set(read.ids)
    assert len(read.ids) == len(set(read.ids))
    assert "default-src 'none'" in html and "<script" not in html and "script-src" not in html


def test_words_from_outside_run_nothing(report):
    hostile = replace(
        report,
        **dict.fromkeys(("title", "verdict", "advice", "settings", "command"), HOSTILE),
        reasons=[HOSTILE],
        recommendations=[HOSTILE],
        facts={HOSTILE: HOSTILE},
        joint_names=(HOSTILE, "$elbow"),
        findings=[Finding("error", HOSTILE, HOSTILE)],
        signals=[signals(HOSTILE, "training")],
        parameters=PARAMETERS.assign(name=HOSTILE, formula=HOSTILE),
        files={HOSTILE: f'"{HOSTILE}'},
    )
    html = report_html(hostile)
    assert HOSTILE not in html and HOSTILE in Page(html).text


def test_what_is_not_known_is_left_out():
    html = report_html(bare())
    text = Page(html).text
    for heading in ("What to do next", "The data", "What is left over", "Friction", "nMSE, validation"):
        assert heading not in text
    assert "No verdict." in text and 'class="verdict poor"' in html


def test_many_long_recordings_make_no_large_file(monkeypatch):
    assert len(plots.shown_recordings([signals("short", "training")] * 40)) == 12
    monkeypatch.setattr(plots, "_RECORDINGS", 2)
    html = report_html(replace(bare(), signals=[signals("long", "training", 100_000)] * 40))
    assert "38 more recordings are not shown" in html
    assert len(html) < 1e6


def test_the_file_is_the_page_whose_bytes_are_always_the_same(tmp_path):
    write_report(bare(), tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == report_html(bare())


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


def test_autocorrelation_of_a_wave_is_a_wave():
    x = np.sin(np.arange(20_000) * 2 * np.pi / 40)
    expected = np.cos(np.arange(61) * 2 * np.pi / 40)
    np.testing.assert_allclose(plots.autocorrelation(x), expected, atol=5e-3)


def test_autocorrelation_of_noise_and_of_nothing():
    noise = plots.autocorrelation(np.random.default_rng(0).normal(size=40_000))
    assert noise[0] == 1
    assert np.abs(noise[1:]).max() < 0.02
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
    assert first.startswith("a and b (−0.9): their sum")
    assert second.startswith("b and c (0.85): their difference")
    assert page.hard_to_tell_apart(np.eye(3), "abc") == []
    assert page.hard_to_tell_apart(np.ones((5, 5)), "abcde")[-1] == "and 2 more pairs"


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (1.23456, "1.235"), (-2.5e-7, "−2.5·10⁻⁷"), (1.5e12, "1.5·10¹²"), (-3e-17, "0"), (np.nan, "—"),
        (np.inf, "∞"), (0.0, "0"),
    ],
)  # fmt: skip
def test_numbers_for_people(value, text):
    assert page.number(value) == text


def test_every_plot_survives_one_joint_and_silence(report):
    still = Signals("still", "validation", np.arange(4.0), np.zeros((4, 1)), np.zeros((4, 1)))
    one = replace(
        report,
        joint_names=("the_only_joint_" * 5,),
        errors=pd.DataFrame({"nmse_validation": [np.nan]}),
        signals=[still],
        covariance=np.zeros((3, 3)),
        condition_number=np.inf,
        friction=Friction(*[np.zeros((1, 2))] * 2, *[np.zeros((1, 1))] * 2),
    )
    assert Page(report_html(one)).tags.count("svg") == 5
