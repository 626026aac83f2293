"""Stock arms, against coal on their meshes: no collision is missed, hardly a free configuration refused."""

import pytest

from sidegan.robot import Setup, load_robot
from sidegan.validity import default_home
from sidegan.validity.accuracy import shape_accuracy
from sidegan.validity.constraints import Constraints
from tests.robot.test_catalogue import ROBOTS, readable

pytestmark = pytest.mark.skipif(ROBOTS is None, reason="needs example-robot-data, the extra arms")

ARMS = (
    "ur_description/urdf/ur10_robot.urdf",
    "panda_description/urdf/panda.urdf",
    "z1_description/urdf/z1.urdf",
)


@pytest.mark.parametrize("name", ARMS)
def test_nothing_is_missed_and_little_is_refused(name: str) -> None:
    arm = load_robot(ROBOTS / name, readable(ROBOTS / name))
    refused, missed = shape_accuracy(arm, 1_000)
    assert missed == 0
    assert refused <= 0.01


def test_one_piece_a_link_misses_nothing_either() -> None:
    path = ROBOTS / ARMS[0]
    few, many = (load_robot(path, Setup(pieces=pieces, finer=pieces)) for pieces in (1, 4))
    assert len(few.capsules.names) < len(many.capsules.names) and few.digest != many.digest
    refused, missed = shape_accuracy(few, 500)
    assert missed == 0
    assert refused > 0.1  # the hull of a whole forearm is too much
    assert shape_accuracy(many, 500)[0] < 0.01


def test_an_upright_ur10_can_rest() -> None:
    """Zeros are refused by one capsule a link, and by meshes they are not."""
    arm = load_robot(ROBOTS / ARMS[0])
    constraints = Constraints(arm)
    assert default_home(constraints) is None
    constraints.refuse_home([0.0, -1.5708, 0.0, -1.5708, 0.0, 0.0])
