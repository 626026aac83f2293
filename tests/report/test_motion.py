import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest
import torch
from matplotlib.image import imread

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.report import motion, spatial
from sidegan.report.canvas import save

FAMILY = Trajectory(2, harmonics=3, period=4.0)
LONG = Trajectory(2, harmonics=5, period=12.0)


def some(family, count):
    source = torch.Generator().manual_seed(count)
    return 0.3 * torch.randn(count, *family.shape, dtype=torch.float64, generator=source)


@pytest.fixture
def bundles():
    return {"long-5": (LONG, some(LONG, 1)), "eigen": (FAMILY, some(FAMILY, 3))}


def test_traces_have_a_panel_each_at_one_scale(planar):
    figure = motion.traces(planar, FAMILY, some(FAMILY, 5))
    assert len(figure.axes) == 5
    assert len({axis.get_xlim() + axis.get_zlim() for axis in figure.axes}) == 1


def test_sets_stand_side_by_side_at_one_scale(planar, bundles):
    figure = motion.stacked(planar, bundles, desk=None)
    titles = [axis.get_title() for axis in figure.axes]
    assert titles == ["single long, 5 harmonics\n12 s", "seeds + eigen\n3 × 4 s"]
    assert figure.axes[0].get_xlim() == figure.axes[1].get_xlim()


def test_snapshots_have_a_panel_per_instant_and_can_be_written(planar, tmp_path):
    figure = motion.snapshots(planar, FAMILY, some(FAMILY, 1), count=4)
    assert [axis.get_title() for axis in figure.axes] == ["0.5 s", "1.5 s", "2.5 s", "3.5 s"]
    png, svg = save(figure, tmp_path / "snapshots")
    assert np.ptp(imread(png)[..., :3]) > 0.5
    assert ElementTree.parse(svg).getroot().tag.endswith("svg")
    assert svg.stat().st_size < 2_000_000


def test_the_same_figure_gives_the_same_files(planar, tmp_path):
    for name in ("a", "b"):
        save(motion.traces(planar, FAMILY, some(FAMILY, 1)), tmp_path / name)
    for suffix in (".png", ".svg"):
        assert (tmp_path / f"a{suffix}").read_bytes() == (tmp_path / f"b{suffix}").read_bytes()


def test_interactive_paths_are_those_of_the_static_figures(planar, bundles):
    figure = spatial.traces(planar, FAMILY, some(FAMILY, 5))
    assert [trace.type for trace in figure.data] == ["scatter3d"] * 5 + ["mesh3d"]
    figure = spatial.stacked(planar, bundles, desk=None)
    assert [trace.name for trace in figure.data] == [
        "single long, 5 harmonics, 12 s",
        "seeds + eigen, 3 × 4 s",
    ]
    assert len(figure.data[1].x) == 3 * 101


@pytest.mark.parametrize("desk", [0.0, None])
def test_the_slider_shows_one_arm_at_a_time(planar, desk):
    figure = spatial.snapshots(planar, FAMILY, some(FAMILY, 1), count=3, desk=desk)
    (slider,) = figure.layout.sliders
    for k, step in enumerate(slider.steps):
        shown = step.args[1]
        assert len(shown) == len(figure.data)
        assert list(shown[1:4]) == [i == k for i in range(3)]
        assert shown[0] and all(shown[4:])


@pytest.mark.parametrize("module", [motion, spatial])
def test_what_cannot_be_drawn_is_refused(planar, module):
    with pytest.raises(ShapeError, match="no trajectory"):
        module.traces(planar, FAMILY, some(FAMILY, 0))
    with pytest.raises(ShapeError, match="no sets"):
        module.stacked(planar, {})
    with pytest.raises(ShapeError, match="no trajectory"):
        module.stacked(planar, {"seeds": (FAMILY, some(FAMILY, 0))})
    with pytest.raises(ShapeError, match="one trajectory"):
        module.snapshots(planar, FAMILY, some(FAMILY, 2))
    with pytest.raises(ShapeError, match="coefficients are"):
        module.traces(planar, LONG, some(FAMILY, 1))
