"""The report of an identification: everything is shown, escaped, offline."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.identification.estimate import Score
from sidegan.report.identification import results
from sidegan.report.identification.content import Origin, parameter_table
from sidegan.report.identification.results import format_number, report_html
from tests.identification import recordings
from tests.report.pages import Page

HOSTILE = '<script>alert("x")</script>&'
FILES = {f"arm{HOSTILE}.urdf": Score(np.array([0.0123, 0.0457]), np.ones(2))}
ORIGIN = Origin(f"sidegan.run identify {HOSTILE}", HOSTILE, {"model": {"method": "x", HOSTILE: HOSTILE}})


def interrupted(made):
    """A recording that misses a second in the middle."""
    return replace(made, time=made.time + (np.arange(len(made.time)) >= len(made.time) // 2))


def checked(arm, seed, name, **changes):
    recording = recordings.checked(arm, seed, change=interrupted, rate=50)
    return replace(recording, statistics=replace(recording.statistics, name=name), **changes)


@pytest.fixture(scope="module")
def identified(planar):
    """An arm with a joint that slides, whose names, and those of its recordings, are not to be trusted."""
    names = {"name": f"planar2{HOSTILE}", "joint_names": (f"shoulder{HOSTILE}", "$elbow")}
    names["link_names"] = HOSTILE, "forearm"
    arm = replace(planar, **names, prismatic=np.array([False, True]))
    training = checked(arm, 0, f"a.csv{HOSTILE}")
    return recordings.identified(arm, [training], [checked(arm, 1, f"b.csv{HOSTILE}", role="validation")])


@pytest.fixture(scope="module")
def html(identified):
    return report_html(identified, ORIGIN, FILES).decode()


@pytest.fixture(scope="module")
def read(html):
    return Page(html)


def test_the_report_has_every_section(identified, read):
    verdict = f"{identified.quality.verdict}: mean nMSE"
    for words in (
        "Identification of planar2", verdict, *identified.quality.reasons, "Use the consistent model",
        "1 gap", "750 samples", "shoulder", "elbow", identified.model.formulas[0],
        "forearm", "nMSE, validation", "What counts", "arm", "0.0123", "0.029", "method: x",
        "sidegan.run identify",
    ):  # fmt: skip
        assert words in read.text, words
    order = (verdict, "1 gap", "750 samples", "stands for")
    places = [read.text.index(words) for words in order]  # warnings come before what is fine
    assert places == sorted(places)


def test_every_plot_is_drawn_with_its_words(read):
    names = ("torques-1", "torques-2", "friction")
    assert [name for name in read.ids if name.startswith("plot-")] == [f"plot-{name}" for name in names]
    assert read.tags.count("svg") == len(names)
    for words in ("measured", "identified", "velocity [rad/s]", "velocity [m/s]", "[N·m]", "$elbow [N]"):
        assert words in read.text, words


def test_the_page_loads_nothing_external(html, read):
    assert all(link[0] == "#" and link[1:] in read.ids for link in read.links)
    assert len(read.ids) == len(set(read.ids))
    assert "default-src 'none'" in html and "<script" not in html and "script-src" not in html
    assert len(html) < 1e6


def test_names_are_escaped_in_the_page(html, read):
    assert HOSTILE not in html and HOSTILE in read.text


def test_empty_sections_are_left_out(identified, monkeypatch):
    monkeypatch.setattr(results, "_RECORDINGS", 1)
    pulled = replace(identified.quality, other_gravity=True)
    changed = replace(identified, quality=pulled, tested=identified.trained)
    text = Page(report_html(changed, ORIGIN, FILES).decode()).text
    assert "nMSE, validation" not in text and "What counts" not in text
    assert "not shown: 1." in text and "Use none of these models" in text


NUMBERS = {1.23456: "1.235", -2.5e-7: "-2.5e-7", 1.5e12: "1.5e12", -3e-17: "0", np.nan: "—", np.inf: "—"}


@pytest.mark.parametrize(("value", "text"), NUMBERS.items())
def test_numbers_are_rounded_for_reading(value, text):
    assert format_number(value) == text


def test_parameters_of_sliding_joints_have_their_units(identified):
    unit = parameter_table(identified).set_index("name").unit
    assert unit[["fv1", "fc1", "fv2", "fc2"]].tolist() == ["N·m·s/rad", "N·m", "N·s/m", "N"]
