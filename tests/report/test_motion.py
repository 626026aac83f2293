import numpy as np
import pytest
import torch
from matplotlib.image import imread

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.report import motion, spatial
from sidegan.report.canvas import save
from sidegan.report.pose import Bundle, film, scene

FAMILY = Trajectory(2, harmonics=3, period=4.0)
LONG = Trajectory(2, harmonics=5, period=12.0)


def some(family, count):
    source = torch.Generator().manual_seed(count)
    return 0.3 * torch.randn(count, *family.shape, dtype=torch.float64, generator=source)


@pytest.fixture
def traces(planar):
    return scene(planar, [Bundle(f"trajectory {k}", FAMILY, c[None]) for k, c in enumerate(some(FAMILY, 5))])


@pytest.fixture
def sets(planar):
    long = Bundle("long\n12 s", LONG, some(LONG, 1), "#b2182b")
    return scene(planar, [long, Bundle("eigen", FAMILY, some(FAMILY, 3), "#1f77b4")], desk=None)


def test_bundles_have_a_panel_each_at_one_scale(traces, sets):
    for shown in (traces, sets):
        figure = motion.paths(shown)
        assert [axis.get_title() for axis in figure.axes] == [bundle.title for bundle in shown.bundles]
        assert len({axis.get_xlim() + axis.get_zlim() for axis in figure.axes}) == 1


def test_snapshots_have_a_panel_per_instant_and_can_be_written(planar, tmp_path):
    figure = motion.snapshots(film(planar, FAMILY, some(FAMILY, 1), count=4))
    assert [axis.get_title() for axis in figure.axes] == ["0.5 s", "1.5 s", "2.5 s", "3.5 s"]
    assert np.ptp(imread(save(figure, tmp_path / "snapshots"))[..., :3]) > 0.5


def test_the_same_figure_gives_the_same_file(traces, tmp_path):
    first, second = (save(motion.paths(traces), tmp_path / name) for name in ("a", "b"))
    assert first.read_bytes() == second.read_bytes()


def test_interactive_paths_are_those_of_the_static_figures(traces, sets):
    figure = spatial.paths(traces)
    assert [trace.type for trace in figure.data] == ["scatter3d"] * 5 + ["mesh3d"]
    assert all(trace.visible is True for trace in figure.data[:5])
    figure = spatial.paths(sets)
    assert [trace.name for trace in figure.data] == ["long, 12 s", "eigen"]
    assert len(figure.data[1].x) == 3 * 101


@pytest.mark.parametrize("desk", [0.0, None])
def test_the_slider_shows_one_arm_at_a_time(planar, desk):
    figure = spatial.snapshots(film(planar, FAMILY, some(FAMILY, 1), count=3, desk=desk))
    (slider,) = figure.layout.sliders
    for k, step in enumerate(slider.steps):
        shown = step.args[1]
        assert len(shown) == len(figure.data)
        assert list(shown[1:4]) == [i == k for i in range(3)]
        assert shown[0] and all(shown[4:])


def test_what_cannot_be_drawn_is_refused(planar):
    with pytest.raises(ShapeError, match="no sets"):
        scene(planar, [])
    with pytest.raises(ShapeError, match="no trajectory"):
        scene(planar, [Bundle("seeds", FAMILY, some(FAMILY, 0))])
    with pytest.raises(ShapeError, match="one trajectory"):
        film(planar, FAMILY, some(FAMILY, 2))
    with pytest.raises(ShapeError, match="coefficients are"):
        scene(planar, [Bundle("seeds", LONG, some(FAMILY, 1))])
