import numpy as np
import pandas as pd
import pytest

from sidegan.errors import ConfigError, ShapeError
from sidegan.report import interactive
from tests.report.test_figures import CURVE, HISTORY, SEEDS, results


def names(figure):
    """What the legend of a figure says."""
    return [trace.name for trace in figure.data if trace.name and trace.showlegend is not False]


def test_training_names_each_line_once():
    figure = interactive.training(
        {"vanilla": [HISTORY, HISTORY], "eigen": [HISTORY]}, SEEDS, {"distance": 2.0}
    )
    assert names(figure) == ["vanilla", "eigen", "seeds", "seeds and generated"]
    assert figure.layout.yaxis2.type == "log"
    # A variant's line and band in each of six panels, five references of the seeds, one of the union.
    assert len(figure.data) == 6 * 2 * 2 + 5 + 1


def test_a_band_has_no_hole_where_a_metric_is_unknown():
    figure = interactive.training({"eigen": [HISTORY]}, {})
    assert all(
        np.isfinite(np.asarray(trace.y, float)).all() for trace in figure.data if trace.fill == "toself"
    )


@pytest.mark.parametrize("weightings", [(False,), (False, True)])
def test_errors_have_bars_with_whiskers(weightings):
    figure = interactive.errors(results(*weightings))
    assert names(figure) == ["single long, 6 harmonics", "seeds", "seeds + eigen"]
    assert len(figure.data) == 3 * len(weightings)
    assert all(list(bar.x) == ["shoulder", "elbow"] for bar in figure.data)
    assert list(figure.data[0].error_y.array) == pytest.approx([0, 0])


def test_a_curve_keeps_its_places():
    figure = interactive.curve(CURVE, "count", "share", "set", log_x=True, references={"paper": 9.0})
    assert names(figure) == ["seeds", "eigen", "paper"]
    assert list(figure.data[1].x) == [240, 450, 1800]
    assert figure.layout.scattermode is None  # would move the lines aside
    assert list(figure.layout.xaxis.ticktext) == ["240", "450", "1800"]


def test_a_curve_over_text_stands_side_by_side():
    frame = CURVE.assign(count=CURVE["count"].astype(str))
    figure = interactive.curve(
        frame, "count", "share", "set", labels={"eigen": "SIDE-GAN"}, references={"x": 1}
    )
    assert names(figure) == ["seeds", "SIDE-GAN", "x"]
    assert figure.layout.scattermode == "group"


def test_seeds_and_durations_are_drawn():
    frame = pd.DataFrame({"kind": ["a", "a", "b"], "q": [1.0, 3.0, 5.0], "d": [1.0, 2.0, 3.0]})
    figure = interactive.quality_diversity(frame, "q", "d", "kind")
    assert names(figure) == ["a (2)", "a, median", "b (1)", "b, median"]
    figure = interactive.timing(pd.DataFrame({"what": ["a"], "ours": [0.4], "paper": [360.0]}))
    assert [bar.text[0] for bar in figure.data] == ["6 min", "400 ms"]


def test_data_that_cannot_be_drawn_are_refused():
    with pytest.raises(ConfigError, match="no column"):
        interactive.curve(CURVE, "seeds", "share")
    with pytest.raises(ShapeError, match="positive"):
        interactive.timing(pd.DataFrame({"what": [], "ours": [], "paper": []}))
