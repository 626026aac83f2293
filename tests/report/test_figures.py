import xml.etree.ElementTree as ElementTree

import pandas as pd
import pytest
from matplotlib.image import imread

from sidegan.errors import ConfigError, StorageError
from sidegan.report import figures

SEEDS = {"valid": 1.0, "condition": 80.0, "distance": 3.0, "nearest": 1.5, "rank": 20.0}
HISTORY = [
    {
        "success": 0.1,
        "condition": 1e4,
        "distance": 3.0,
        "rank": 3.0,
        "nearest": 1.0,
        "distance_diagonal": 2.0,
    },
    {
        "success": 0.9,
        "condition": None,
        "distance": 2.0,
        "rank": 4.0,
        "nearest": 0.5,
        "distance_diagonal": 1.0,
    },
]


def results(*weightings):
    rows = [
        (name, weighted, joint, repeat, 0.1)
        for name in ("eigen", "long-6", "seeds")
        for weighted in weightings
        for joint in ("shoulder", "elbow")
        for repeat in (0, 1)
    ]
    return pd.DataFrame(rows, columns=["set", "weighted", "joint", "repeat", "nmse"])


def legend(figure):
    """What the legend of a figure says."""
    return [text.get_text() for text in figure.legends[0].get_texts()] if figure.legends else []


def test_training_has_a_line_per_variant_and_a_dashed_one_for_the_seeds():
    figure = figures.training({"vanilla": [HISTORY, HISTORY[::-1]], "eigen": [HISTORY[:1]]}, SEEDS)
    panels = {axis.get_title(): axis for axis in figure.axes}
    assert len(panels) == 6
    success = panels["success rate"].get_lines()
    assert [line.get_label() for line in success] == ["vanilla", "eigen", "seeds"]
    assert list(success[0].get_xdata()) == [1, 2] and list(success[0].get_ydata()) == [0.5, 0.5]
    assert list(success[2].get_ydata()) == [1.0, 1.0]
    assert len(panels["mean distance of diag(YᵀY)"].get_lines()) == 2  # the seeds' is not known
    assert panels["median cond(YᵀY)"].get_yscale() == "log"


def test_the_union_is_a_line_of_its_own():
    figure = figures.training({"eigen": [HISTORY]}, SEEDS, union={"distance_diagonal": 7.0})
    assert legend(figure) == ["eigen", "seeds", "seeds and generated"]
    (axis,) = (axis for axis in figure.axes if axis.get_title() == "mean distance of diag(YᵀY)")
    assert list(axis.get_lines()[-1].get_ydata()) == [7.0, 7.0]


@pytest.mark.parametrize("weightings", [(False,), (False, True)])
def test_errors_have_a_panel_per_weighting_and_a_bar_per_set_and_joint(weightings):
    figure = figures.errors(results(*weightings))
    assert len(figure.axes) == len(weightings)
    for axis in figure.axes:
        assert axis.get_yscale() == "log"
        assert len(axis.patches) == 3 * 2
        assert all(bar.get_height() == pytest.approx(0.1) for bar in axis.patches)
        assert [label.get_text() for label in axis.get_xticklabels()] == ["shoulder", "elbow"]
    assert legend(figure) == ["single long, 6 harmonics", "seeds", "seeds + eigen"]


def test_errors_have_whiskers_over_the_range():
    raw = results(False)
    raw.loc[raw["repeat"] == 1, "nmse"] = 0.3
    figure = figures.errors(raw)
    (segments, *_) = figure.axes[0].collections[0].get_segments()
    assert segments[:, 1] == pytest.approx([0.1, 0.3])


CURVE = pd.DataFrame(
    [(n, name, n / k) for n in (240, 450, 1800) for name in ("seeds", "eigen") for k in (1.0, 2.0)],
    columns=["count", "set", "share"],
)


def test_a_curve_has_a_line_and_a_band_per_group():
    words = {"count": "seeds in the training set", "eigen": "SIDE-GAN"}
    figure = figures.curve(CURVE, "count", "share", "set", log_x=True, labels=words, references={"paper": 9})
    (axis,) = figure.axes
    assert legend(figure) == ["seeds", "SIDE-GAN", "paper"]
    assert axis.get_xlabel() == "seeds in the training set" and axis.get_ylabel() == "share"
    assert axis.get_xscale() == "log" and axis.get_yscale() == "linear"
    assert [label.get_text() for label in axis.get_xticklabels()] == ["240", "450", "1800"]
    assert len(axis.collections) == 2
    assert list(axis.get_lines()[0].get_ydata()) == [180, 337.5, 1350]


def test_a_curve_without_groups_has_no_legend():
    figure = figures.curve(CURVE, "count", "share", log_y=True)
    assert legend(figure) == [] and figure.axes[0].get_yscale() == "log"


def test_places_of_text_have_dots_beside_each_other():
    frame = CURVE.assign(count=CURVE["count"].map({240: "noise", 450: "prior", 1800: "all"}))
    figure = figures.curve(frame, "count", "share", "set")
    (axis,) = figure.axes
    assert [label.get_text() for label in axis.get_xticklabels()] == ["noise", "prior", "all"]
    first, second = (container.lines[0].get_xdata() for container in axis.containers)
    assert (second - first > 0.05).all() and (second - first < 0.5).all()


def test_kinds_of_seeds_are_points_with_their_medians():
    frame = pd.DataFrame({"kind": ["a", "a", "b"], "q": [1.0, 3.0, 5.0], "d": [1.0, 2.0, 3.0]})
    figure = figures.quality_diversity(frame, "q", "d", "kind", labels={"q": "cond"})
    (axis,) = figure.axes
    assert legend(figure) == ["a (2)", "b (1)", "median"]
    assert axis.get_ylabel() == "cond" and axis.get_yscale() == "log"
    assert [(*line.get_xdata(), *line.get_ydata()) for line in axis.get_lines()] == [(1.5, 2.0), (3.0, 5.0)]
    with pytest.raises(ConfigError, match="no column kind"):
        figures.quality_diversity(frame.drop(columns="kind"), "q", "d", "kind")


def test_durations_are_bars_with_words():
    frame = pd.DataFrame({"what": ["seed", "pick"], "ours": [0.4, 2.0], "paper": [360.0, None]})
    figure = figures.timing(frame)
    (axis,) = figure.axes
    assert axis.get_xscale() == "log"
    assert sorted(text.get_text() for text in axis.texts) == ["2 s", "400 ms", "6 min"]
    ends = sorted(bar.get_x() + bar.get_width() for bar in axis.patches)
    assert ends == pytest.approx([0.4, 2.0, 360.0])


def test_figures_are_written_as_png_and_svg_that_open(tmp_path):
    for name, figure in {
        "training": figures.training({"eigen": [HISTORY]}, SEEDS),
        "nmse": figures.errors(results(False)),
    }.items():
        png, svg = figures.save(figure, tmp_path / name)
        assert (png.name, svg.name) == (f"{name}.png", f"{name}.svg")
        height, width, _ = imread(png).shape
        assert width == 11 * 150 and height > 500
        assert imread(png)[..., :3].min() < 0.5  # something is drawn
        assert ElementTree.parse(svg).getroot().tag.endswith("svg")
    assert len(list(tmp_path.iterdir())) == 4


def test_a_folder_that_cannot_be_written_is_told(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError):
        figures.save(figures.errors(results(False)), tmp_path / "file" / "nmse")
