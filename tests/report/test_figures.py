import xml.etree.ElementTree as ElementTree

import pandas as pd
import pytest
from matplotlib.image import imread

from sidegan.errors import StorageError
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


@pytest.mark.parametrize("weightings", [(False,), (False, True)])
def test_errors_have_a_panel_per_weighting_and_a_bar_per_set_and_joint(weightings):
    figure = figures.errors(results(*weightings))
    assert len(figure.axes) == len(weightings)
    for axis in figure.axes:
        assert axis.get_yscale() == "log"
        assert len(axis.patches) == 3 * 2
        assert all(bar.get_height() == pytest.approx(0.1) for bar in axis.patches)
        assert [label.get_text() for label in axis.get_xticklabels()] == ["shoulder", "elbow"]
    legend = [text.get_text() for text in figure.axes[-1].get_legend().get_texts()]
    assert legend == ["single long, 6 harmonics", "seeds", "seeds + eigen"]


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
