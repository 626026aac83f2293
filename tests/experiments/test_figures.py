"""Figures of results: what is drawn is what the frame holds."""

import numpy as np
import pandas as pd
import pytest

from experiments import figures
from experiments.sets import colour, colours
from sidegan.report.canvas import blank, from_zero, svg
from tests.report.pages import Page

SEEDS = {"invalid": 0.0, "condition": 80.0, "distance": 3.0, "nearest": 1.5, "rank_uncentred": 20.0}
HISTORY = pd.DataFrame({"invalid": [0.9, 0.1], "condition": [1e4, None], "distance": [3.0, 2.0]})
HISTORY = HISTORY.assign(distance_diagonal=[2.0, 1.0], nearest=1.0, rank_uncentred=3.0, cosine=0.5)
HISTORY = HISTORY.assign(condition_mean=2e4, error=0.1, error_constant=0.2, epoch=[1, 2])


def results(*weightings):
    """Errors of 0.1 and 0.3 of every set and joint."""
    rows = [
        (name, weighted, joint, nmse)
        for name in ("eigen", "long-6", "seeds")
        for weighted in weightings
        for joint in ("shoulder", "elbow")
        for nmse in (0.1, 0.3)
    ]
    return pd.DataFrame(rows, columns=["set", "weighted", "joint", "nmse"])


def legend(figure):
    """What the legend of a figure says."""
    return [text.get_text() for text in figure.legends[0].get_texts()]


def test_metrics_have_a_line_per_variant_and_a_dashed_line_for_seeds():
    back = HISTORY[::-1].reset_index(drop=True).assign(epoch=[1, 2])
    parts = {"vanilla": pd.concat([HISTORY, back]), "eigen": HISTORY[:1]}
    frame = pd.concat([part.assign(variant=name) for name, part in parts.items()])
    references = {"seeds": SEEDS, "union": {"distance_diagonal": 7.0}}
    figure = figures.panels(frame, references)
    panels = {axis.get_ylabel(): axis for axis in figure.axes}
    assert [axis.get_title("left") for axis in figure.axes] == list("abcdefghi")
    assert len(panels) == 9 and legend(figure) == ["vanilla", "eigen", "seeds", "union"]
    vanilla, eigen, seeds = panels["invalid share"].get_lines()
    assert list(vanilla.get_xdata()) == [1, 2] and list(vanilla.get_ydata()) == pytest.approx([0.5, 0.5])
    assert list(eigen.get_ydata()) == [0.9] and list(seeds.get_ydata()) == [0.0, 0.0]
    assert panels["invalid share"].get_yscale() == "symlog" and panels["invalid share"].get_ylim()[0] < 0
    lines = panels["mean distance of diag(YᵀY)"].get_lines()  # the seeds' is not known
    assert len(lines) == 3 and list(lines[-1].get_ydata()) == [7.0, 7.0]
    condition = panels["median cond(YᵀY)"]
    assert condition.get_yscale() == "log"
    assert condition.get_ylim() == panels["mean cond(YᵀY)"].get_ylim()
    assert list(condition.get_lines()[0].get_ydata()) == pytest.approx([1e4, 1e4])  # of those that are known


def test_an_axis_of_shares_that_are_all_zero_begins_at_zero():
    axis = blank(2, 2).subplots()
    from_zero(axis, pd.Series([0.0, 0.0]))
    assert axis.get_ylim()[0] < 0 < axis.get_ylim()[1]


@pytest.mark.parametrize("weightings", [(False,), (False, True)])
def test_errors_have_a_panel_per_weighting_and_a_whisker_per_set_and_joint(weightings):
    figure = figures.errors(results(*weightings))
    assert len(figure.axes) == len(weightings)
    for axis in figure.axes:
        assert axis.get_yscale() == "log" and len(axis.containers) == 3
        places = [container.lines[0].get_xydata() for container in axis.containers]
        assert np.concatenate(places)[:, 1] == pytest.approx([0.2] * 6)
        assert (np.abs(np.array(places)[..., 0] - [0, 1]) < 0.4).all()
        assert axis.collections[0].get_segments()[0][:, 1] == pytest.approx([0.1, 0.3])
        assert [label.get_text() for label in axis.get_xticklabels()] == ["shoulder", "elbow"]
    assert legend(figure) == ["single long, 6 harmonics", "seeds", "seeds + eigen"]


def test_single_long_trajectories_have_different_colours_whatever_their_harmonics():
    shades = colours(["long-3", "long-12", "seeds", "eigen"])
    assert len(set(shades)) == 4 and shades[2] == colour("seeds")
    assert colours(["long-210", "long-6"]) == shades[1::-1]


def test_clouds_of_a_space_share_axes_and_offsets_show():
    random = np.random.default_rng(0)
    seeds, like = (0.1 * random.uniform(-1, 1, (50, 12)) for _ in range(2))
    sets = {"seeds": seeds, "vanilla": like, "eigen": like + 0.5}
    figure = figures.clouds({"coefficients": sets, "features": {name: x[:, :3] for name, x in sets.items()}})
    assert [axis.get_title() for axis in figure.axes] == ["vanilla", "eigen"] * 2
    assert [axis.get_title("left") for axis in figure.axes] == list("abcd")
    assert legend(figure) == list(sets) and figure.axes[0].get_xlim() == figure.axes[1].get_xlim()
    apart = [np.diff([x.get_offsets().mean(0) for x in axis.collections], axis=0) for axis in figure.axes]
    sizes = [np.linalg.norm(x) for x in apart]
    assert sizes[0] < 0.1 and sizes[1] == pytest.approx(0.5 * np.sqrt(12), rel=0.1)
    assert figure.axes[0].get_xlabel().startswith("coefficients, axis 1 (9")  # per cent: the offset


def test_an_svg_has_text_unique_ids_and_reproducible_bytes(recwarn):
    words = "$a$ < b & 肩 1.23456"

    def drawn(name):
        figure = blank(2, 2)
        figure.subplots().plot([0, 1.23456], "o-", label=words)
        figure.axes[0].legend()
        return svg(figure, name, words)

    first, other = (Page(drawn(name)) for name in ("a", "b"))
    assert words in first.text and not recwarn.list
    assert drawn("a") == drawn("a")
    assert first.ids and len(first.ids) == len(set(first.ids)) and not set(first.ids) & set(other.ids)
