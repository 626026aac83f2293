"""What the room refuses: its error, what the error says, and that no file is left."""

from types import SimpleNamespace

import numpy as np
import pytest
from jinja2 import UndefinedError

from sidegan.errors import ShapeError
from sidegan.motion.trajectory import Trajectory
from sidegan.report.document import write_page
from sidegan.report.motion import Bundle, paths

ANOTHER, LONG = np.zeros((1, 2, 3, 2)), Trajectory(2, harmonics=5, period=12.0)


@pytest.fixture
def there(planar, tmp_path):
    """Something to draw, and a template."""
    (template := tmp_path / "page.md.j2").write_text("{{ nothing }}")
    return SimpleNamespace(arm=planar, folder=tmp_path, template=template)


REFUSALS = [
    (lambda x: write_page(x.template, x.folder / "a.md", {}, {}), UndefinedError, "nothing"),
    (lambda x: paths(x.arm, []), ShapeError, "no sets"),
    (lambda x: paths(x.arm, [Bundle("a", LONG, ANOTHER)]), ShapeError, "coefficients are"),
]


@pytest.mark.parametrize(("ask", "error", "words"), REFUSALS)
def test_is_refused(there, ask, error, words):
    before = sorted(there.folder.iterdir())
    with pytest.raises(error, match=words):
        ask(there)
    assert sorted(there.folder.iterdir()) == before
