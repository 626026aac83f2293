import pandas as pd
import pytest
from matplotlib.image import imread

from sidegan.errors import StorageError
from sidegan.report import figures
from sidegan.report.canvas import save
from sidegan.report.figures import Across, Panel

SEEDS = {"success": 1.0, "condition": 80.0, "distance": 3.0, "nearest": 1.5, "rank": 20.0}
HISTORY = pd.DataFrame(
    {
        "success": [0.1, 0.9],
        "condition": [1e4, None],
        "distance": [3.0, 2.0],
        "rank": [3.0, 4.0],
        "nearest": [1.0, 0.5],
        "distance_diagonal": [2.0, 1.0],
        "epoch": [1, 2],
    }
)
BACK = HISTORY[::-1].reset_index(drop=True).assign(epoch=[1, 2])


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


def training(references):
    """Two trainings of one variant and one epoch of another."""
    runs = [HISTORY.assign(variant="vanilla", training=0), BACK.assign(variant="vanilla", training=1)]
    frame = pd.concat([*runs, HISTORY[:1].assign(variant="eigen", training=0)])
    shown = figures.metrics(references=references)
    return figures.panels(frame, Across("epoch", "epoch"), shown, "variant", columns=3)


def test_metrics_have_a_line_per_variant_and_a_dashed_one_for_the_seeds():
    figure = training({"seeds": SEEDS, "union": {"distance_diagonal": 7.0}})
    panels = {axis.get_title(): axis for axis in figure.axes}
    assert len(panels) == 6 and legend(figure) == ["vanilla", "eigen", "seeds", "union"]
    vanilla, eigen, seeds = panels["valid share"].get_lines()
    assert list(vanilla.get_xdata()) == [1, 2] and list(vanilla.get_ydata()) == pytest.approx([0.5, 0.5])
    assert list(eigen.get_ydata()) == [0.1] and list(seeds.get_ydata()) == [1.0, 1.0]
    lines = panels["mean distance of diag(YᵀY)"].get_lines()  # the seeds' is not known
    assert len(lines) == 3 and list(lines[-1].get_ydata()) == [7.0, 7.0]
    condition = panels["median cond(YᵀY)"]
    assert condition.get_yscale() == "log"
    assert list(condition.get_lines()[0].get_ydata()) == pytest.approx([1e4, 1e4])  # of those that are known


def test_runs_share_the_colour_of_their_group():
    frame = pd.concat([HISTORY.assign(variant="eigen", training=k) for k in (0, 1)])
    shown = [Panel("success", "share", share=True)]
    figure = figures.panels(frame, Across("epoch", "epoch"), shown, "variant", run="training")
    first, second = figure.axes[0].get_lines()
    assert first.get_color() == second.get_color() and legend(figure) == ["eigen"]
    assert figure.axes[0].get_ylim() == pytest.approx((0.06, 1.005))


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
    across, shown = (
        Across("count", "seeds trained on", log=True),
        [Panel("share", "share", True, {"paper": 9})],
    )
    figure = figures.panels(CURVE, across, shown, "set", columns=1, markers=True)
    (axis,) = figure.axes
    assert legend(figure) == ["seeds", "eigen", "paper"]
    assert axis.get_xlabel() == "seeds trained on" and axis.get_title() == "share"
    assert axis.get_xscale() == "log" and axis.get_yscale() == "log"
    assert len(axis.collections) == 2
    assert list(axis.get_lines()[0].get_ydata()) == pytest.approx([180, 337.5, 1350])
    assert list(axis.get_lines()[0].get_xdata()) == [240, 450, 1800]


def test_kinds_of_seeds_are_points_with_their_medians():
    frame = pd.DataFrame({"kind": ["a", "a", "b"], "quality": [1.0, 3.0, 5.0], "diversity": [1.0, 2.0, 3.0]})
    figure = figures.quality_diversity(frame, ("distance", "cond"))
    (axis,) = figure.axes
    assert legend(figure) == ["a (2)", "b (1)", "median"]
    assert axis.get_ylabel() == "cond" and axis.get_yscale() == "log"
    assert [(*line.get_xdata(), *line.get_ydata()) for line in axis.get_lines()] == [(1.5, 2.0), (3.0, 5.0)]


def test_durations_are_bars_with_words():
    frame = pd.DataFrame({"what": ["seed", "pick"], "ours": [0.4, 2.0], "paper": [360.0, None]})
    figure = figures.timing(frame)
    (axis,) = figure.axes
    assert axis.get_xscale() == "log"
    assert sorted(text.get_text() for text in axis.texts) == ["2 s", "400 ms", "6 min"]
    ends = sorted(bar.get_x() + bar.get_width() for bar in axis.patches)
    assert ends == pytest.approx([0.4, 2.0, 360.0])


def test_figures_are_written_as_png_that_opens(tmp_path):
    for name, figure in {"training": training({}), "nmse.all": figures.errors(results(False))}.items():
        path = save(figure, tmp_path / name)
        assert path.name == f"{name}.png"
        height, width, _ = imread(path).shape
        assert width > 1000 and height > 500
        assert imread(path)[..., :3].min() < 0.5  # something is drawn
    assert len(list(tmp_path.iterdir())) == 2


def test_a_folder_that_cannot_be_written_is_refused(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(StorageError):
        save(figures.errors(results(False)), tmp_path / "file" / "nmse")
