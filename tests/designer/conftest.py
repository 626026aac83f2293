from pathlib import Path

import numpy as np
import pytest
import yaml

import sidegan
from sidegan.base.typed import build
from sidegan.designer import Designer, DesignerSettings, Situation, make_starts
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Plane

CONF = Path(sidegan.__file__).parents[1] / "conf" / "designer" / "default.yaml"
DESK = Plane((0, 0, 1), 0.1)
BOX = Box((0.4, 0.2, 0.3), (0.6, 0.5, 0.7))
WALLS = (Plane((1, 0, 0), -0.8), Plane((-1, 0, 0), -0.8), Plane((0, 1, 0), -0.8))
HOME = (0.1, 0.2, -0.1, 0.5, 0.2, 0.1, 0.0)
SITUATIONS = {
    "nothing": Situation(),
    "home": Situation(HOME),
    "floor": Situation(regions=[Plane((0.0, 0.1, 1.0), 0.15)]),
    "walls": Situation(regions=WALLS, period=12.0),
    "box": Situation(HOME, regions=[BOX], velocity=0.8),
    "boxes and walls": Situation(
        HOME, [BOX, *WALLS, Box((-0.7, -0.7, 0.3), (-0.4, -0.4, 0.5))], 0.7, 0.8, 20.0
    ),
    "clearance": Situation(regions=[BOX], clearance=0.02),
}


@pytest.fixture(scope="session")
def settings():
    values = yaml.safe_load(CONF.read_text(encoding="utf-8"))
    values["library"] = {"count": 4, "steps": 60, "homes": 0.3, "rooms": 0.5}
    return build(DesignerSettings, values)


@pytest.fixture(scope="session")
def workspace(arm):
    return Constraints(arm, [DESK]), Trajectory(7)


@pytest.fixture(scope="session")
def starts(workspace, settings):
    return make_starts(*workspace, settings, np.random.SeedSequence(0))


@pytest.fixture(scope="session")
def designer(workspace, settings, starts):
    return Designer(*workspace, settings, starts)


@pytest.fixture(params=SITUATIONS)
def situation(request):
    return SITUATIONS[request.param]


@pytest.fixture
def plain(monkeypatch, planar, settings):
    """A designer without compiled kernels, of the planar arm."""
    monkeypatch.setenv("SIDEGAN_KERNELS", "torch")
    return Designer(Constraints(planar, [Plane((0, 0, 1), 0.1)]), Trajectory(2, 3, 8.0), settings)
