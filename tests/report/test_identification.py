"""The report of an identification: everything is shown, escaped, offline."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pandas as pd
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st

from sidegan.errors import StorageError
from sidegan.identification.forward import Forward
from sidegan.report.identification import page, plots
from sidegan.report.identification.content import Finding, Friction, Report, Signals, correlation_of
from sidegan.report.identification.page import report_html, write_report

HOSTILE = '<script>alert("x")</script>&'
JOINTS = ("shoulder", "elbow")
NAMES = ("Izz1", "mx2", "fv1")


def signals(name, role, count=300):
    time = np.linspace(0, 3, count)
    measured = np.stack([np.sin(3 * time), np.cos(5 * time)], 1)
    predicted = measured + 0.01 * np.sin(40 * time)[:, None]
    measured[count // 2] = predicted[count // 2] = np.nan
    return Signals(name, role, time, measured, predicted)


def parameters():
    return pd.DataFrame(
        {
            "name": NAMES,
            "formula": ("Izz1 + 0.16 m2", "mx2", "fv1"),
            "unit": ("kg·m²", "kg·m", "N·m·s"),
            "value": (1.25, 3e-5, 2.0),
            "std": (0.01, 1e-3, 0.1),
            "relative_std": (0.008, 33.3, np.inf),
            "urdf": (1.2, 0.0, np.nan),
            "consistent": (1.26, 2e-5, 1.9),
            "weak": (False, True, False),
        }
    )


def forward():
    """Errors of two joints that grow to 0.0123 rad."""
    horizon = torch.linspace(0.05, 1, 20, dtype=torch.float64)
    free = 0.0123 * torch.stack([horizon**2, horizon], 1)
    return Forward(horizon, free, 2 * free, free / 10, 24)


@pytest.fixture
def report():
    columns = ("nmse_training", "nmse_validation", "rmse_training", "rmse_validation")
    velocity = np.tile(np.linspace(-1, 1, 11), (2, 1))
    samples = np.random.default_rng(0).normal(size=(900, 2))
    link = {"link": ("upper", "lower")} | dict.fromkeys(("m", "cx", "cy", "cz"), 1.5)
    link |= dict.fromkeys(("Ixx", "Ixy", "Iyy", "Ixz", "Iyz", "Izz"), 0.25) | {"urdf_m": (1.4, 1.6)}
    return Report(
        title="planar2",
        verdict="The model can be trusted.",
        level="good",
        advice="Use the consistent model.",
        reasons=["It predicts what was held out."],
        facts={"validation nMSE": "0.0042"},
        joint_names=JOINTS,
        torque_units=["N·m"] * len(JOINTS),
        methods={"weighted": "by their noise"},
        findings=[Finding("ok", "a.csv", "300 samples"), Finding("warning", "b.csv", "a gap of 1 s")],
        errors=pd.DataFrame(np.arange(1, 9).reshape(2, 4) / 1000, columns=columns),
        signals=[signals("a.csv", "training"), signals("b.csv", "validation", 4000)],
        parameters=parameters(),
        covariance=np.array([[1e-4, 0, 0], [0, 1e-6, 9.5e-5], [0, 9.5e-5, 1e-2]]),
        condition_number=123.4,
        friction=Friction(velocity, 2 * velocity, samples, 2 * samples),
        forward={"consistent": forward(), "description": forward()},
        links=pd.DataFrame(link),
        left_over=["joint 1: 70% of what is left is <b>friction</b>."],
        recommendations=["Run trajectory 12."],
        settings="method: weighted",
        files={"the verdict": "verdict.json"},
        command="python -m sidegan.pipeline.run",
    )


class _Page(HTMLParser):
    """Text outside scripts, references to elsewhere, and whether tags are closed in order."""

    def __init__(self, html):
        super().__init__()
        self.open, self.text, self.links, self.ids = [], [], [], []
        self.feed(html)

    def handle_starttag(self, tag, attributes):
        found = dict(attributes)
        self.links += [found[key] for key in ("src", "href") if key in found]
        self.ids += [found["id"]] if "id" in found else []
        if tag not in ("meta", "br", "link"):
            self.open.append(tag)

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        if "script" not in self.open and "style" not in self.open:
            self.text.append(data)


def read(report):
    html = _Page(report_html(report))
    assert not html.open
    return html, " ".join(" ".join(html.text).split())


def test_everything_is_told(report):
    _, text = read(report)
    for words in (
        "Identification of planar2", "The model can be trusted.", "It predicts what was held out.", "0.0042",
        "Use the consistent model.", "1.26", "Simulated forwards", "0.012", "24 recorded states",
        "Run trajectory 12.", "a gap of 1 s", "shoulder", "elbow", "Izz1 + 0.16 m2", "3·10⁻⁵", "123", "0.8 %",
        "> 1000 %", "upper", "1.4", "verdict.json", "method: weighted", "python -m sidegan.pipeline.run",
        "Marked: 1 whose uncertainty matters", "mx2 and fv1 (0.95): their difference",
    ):  # fmt: skip
        assert words in text, words
    assert text.index("The model can be trusted.") < text.index("Run trajectory 12.") < text.index("Izz1")


def test_warnings_come_before_what_is_fine(report):
    _, text = read(report)
    assert text.index("a gap of 1 s") < text.index("300 samples")


def test_nothing_comes_from_elsewhere(report):
    html, _ = read(report)
    assert all(link.startswith("#") or link == "verdict.json" for link in html.links)
    assert {link[1:] for link in html.links if link.startswith("#")} <= set(html.ids)
    assert len(html.ids) == len(set(html.ids))
    assert "default-src 'none'" in report_html(report)


def test_words_from_outside_run_nothing(report):
    wrong = pd.DataFrame({**parameters().to_dict("list"), "name": [HOSTILE] * 3, "formula": [HOSTILE] * 3})
    hostile = replace(
        report,
        title=HOSTILE,
        verdict=HOSTILE,
        advice=HOSTILE,
        reasons=[HOSTILE],
        facts={HOSTILE: HOSTILE},
        joint_names=(HOSTILE, "elbow"),
        findings=[Finding("error", HOSTILE, HOSTILE)],
        signals=[signals(HOSTILE, "training")],
        parameters=wrong,
        recommendations=[HOSTILE],
        settings=HOSTILE,
        files={HOSTILE: f'"{HOSTILE}'},
        command=HOSTILE,
    )
    assert HOSTILE not in report_html(hostile)
    assert HOSTILE in read(hostile)[1]


def test_what_is_not_known_is_left_out(report):
    bare = replace(
        report,
        verdict="No verdict.",
        recommendations=(),
        findings=(),
        signals=(),
        errors=report.errors[["nmse_training"]],
        friction=None,
        forward={},
    )
    _, text = read(bare)
    for heading in ("What to do next", "The data", "What is left over", "Friction"):
        assert heading not in text
    assert "nMSE, validation" not in text
    assert "No verdict." in text


@pytest.mark.parametrize("level", ["good", "fair", "poor"])
def test_the_verdict_has_its_colour(report, level):
    assert f'class="verdict {level}"' in report_html(replace(report, level=level))


def test_a_thousand_recordings_make_no_larger_file_than_a_dozen(report):
    one = signals("long", "training", 100_000)
    many = replace(report, signals=[one] * 40)
    html = report_html(many)
    assert "28 more recordings are not shown" in html
    assert len(html) < 12e6


def test_the_file_appears_whole(report, tmp_path):
    write_report(report, tmp_path / "report.html")
    assert (tmp_path / "report.html").read_text(encoding="utf-8") == report_html(report)
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError, match="cannot write"):
        write_report(report, tmp_path / "file" / "report.html")


@given(st.lists(st.floats(-1e6, 1e6), min_size=1, max_size=400), st.integers(2, 40))
def test_thinning_keeps_extremes(values, most):
    x = np.array(values)
    kept = plots.thinned(x, most)
    assert len(kept) <= max(most, 2)
    assert (np.diff(kept) > 0).all()
    assert x[kept].max() == x.max()
    assert x[kept].min() == x.min()


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
        joint_names=("only",),
        errors=pd.DataFrame({"nmse_validation": [np.nan]}),
        signals=[still],
        covariance=np.zeros((3, 3)),
        condition_number=np.inf,
        friction=Friction(*[np.zeros((1, 2))] * 2, *[np.zeros((1, 1))] * 2),
    )
    assert re.search(r'id="plot-friction"', report_html(one))
