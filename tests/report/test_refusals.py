"""What the room refuses: its error, what the error says, and that no file is left."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from jinja2 import UndefinedError

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.report.document import write_page
from sidegan.report.motion import Bundle, paths
from sidegan.report.viewer.page import write_view
from sidegan.validity import Constraints

FAMILY, LONG = Trajectory(2, harmonics=3, period=4.0), Trajectory(2, harmonics=5, period=12.0)
TABLE = pd.DataFrame({"cond": ["7"]})
NONE, ONE, TWO = (np.zeros((count, *FAMILY.shape)) for count in range(3))


@pytest.fixture
def there(planar, tmp_path):
    """Something to draw, and a template."""
    (template := tmp_path / "page.md.j2").write_text("{{ nothing }}")
    view = tmp_path / "view.html", Constraints(planar), planar, FAMILY
    return SimpleNamespace(arm=planar, view=view, folder=tmp_path, template=template)


REFUSALS = [
    (lambda x: write_page(x.template, x.folder / "a.md", {}, {}), UndefinedError, "nothing"),
    (lambda x: paths(x.arm, []), ShapeError, "no sets"),
    (lambda x: paths(x.arm, [Bundle("a", LONG, ONE)]), ShapeError, "coefficients are"),
    (lambda x: write_view(*x.view, NONE, [], TABLE), ShapeError, "0 trajectories to show"),
    (lambda x: write_view(*x.view, TWO, ["a"], TABLE), ShapeError, "2 .* and 1 titles"),
]


@pytest.mark.parametrize(("ask", "error", "words"), REFUSALS)
def test_is_refused(there, ask, error, words):
    before = sorted(there.folder.iterdir())
    with pytest.raises(error, match=words):
        ask(there)
    assert sorted(there.folder.iterdir()) == before
