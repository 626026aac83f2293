"""Every stock description with an arm loads, or does once its refusals' own remedies have been followed.

The descriptions are those of example-robot-data (extra `arms`). All of them are read, reduced and given to
Pinocchio; ``test_arms_table.py`` goes on to trajectories.
"""

from pathlib import Path

import pytest

from sidegan.errors import RobotError
from sidegan.pipeline.compose import composed
from sidegan.robot import Setup
from sidegan.robot.description import read_description
from sidegan.robot.model import build
from tests.robot.arms import ROBOTS, remedied

pytestmark = pytest.mark.skipif(ROBOTS is None, reason="needs example-robot-data, the extra arms")

# file: joints of the arm once the first remedies were followed
ARMS = {
    "anymal_b_simple_description/robots/anymal-kinova.urdf": 6,
    "alex_description/urdf/alex_psyonic_hands.urdf": 10,
    "b1_description/urdf/b1-z1.urdf": 6,
    "baxter_description/urdf/baxter.urdf": 7,
    "centauro_description/urdf/centauro.urdf": 7,
    "double_pendulum_description/urdf/double_pendulum.urdf": 2,
    "double_pendulum_description/urdf/double_pendulum_continuous.urdf": 2,
    "g1_description/urdf/g1_29dof_with_hand_rev_1_0.urdf": 10,
    "icub_description/robots/icub.urdf": 10,
    "kinova_description/robots/kinova.urdf": 6,
    "panda_description/urdf/panda.urdf": 7,
    "panda_description/urdf/panda_collision.urdf": 7,
    "pr2_description/urdf/pr2.urdf": 8,
    "romeo_description/urdf/romeo.urdf": 8,
    "so_arm_description/urdf/so100.urdf": 5,
    "so_arm_description/urdf/so101.urdf": 5,
    "talos_data/robots/talos_full_v2.urdf": 9,
    "talos_data/robots/talos_left_arm.urdf": 6,
    "talos_data/robots/talos_reduced.urdf": 9,
    "tiago_description/robots/tiago.urdf": 8,
    "tiago_description/robots/tiago_dual.urdf": 8,
    "tiago_description/robots/tiago_no_hand.urdf": 8,
    "tiago_pro_description/robots/tiago_pro.urdf": 8,
    "ur_description/urdf/ur10_robot.urdf": 6,
    "ur_description/urdf/ur3_robot.urdf": 6,
    "ur_description/urdf/ur5_gripper.urdf": 6,
    "ur_description/urdf/ur5_joint_limited_robot.urdf": 6,
    "xarm_description/urdf/xarm7.urdf": 7,
    "z1_description/urdf/z1.urdf": 6,
}
NO_ARMS = {"hector_description/robots/quadrotor_base.urdf", "iris_description/robots/iris_simple.urdf"}
EMPTY = {"ur_description/urdf/ur3.urdf"}


def readable(path: Path) -> Setup:
    """A setup with which a description can be read, found by following what the refusals say."""

    def read(words: list[str]) -> Setup:
        setup = composed("+experiment=excite", *words).robot.setup if words else Setup()
        build(read_description(path, setup))
        return setup

    return remedied(read)[0]


@pytest.mark.parametrize("name", ARMS)
def test_loads_or_its_remedies_do(name):
    description = read_description(ROBOTS / name, readable(ROBOTS / name))
    assert len(description.limits) == ARMS[name]
    assert description.missing == {}


def test_all_others_load_or_have_nothing_that_moves():
    for path in sorted([*ROBOTS.glob("*/urdf/*.urdf"), *ROBOTS.glob("*/robots/*.urdf")]):
        name = str(path.relative_to(ROBOTS))
        if name in NO_ARMS | EMPTY:
            with pytest.raises(RobotError, match=r"has no joints that move|has 0 links without a parent"):
                read_description(path)
        elif name not in ARMS:
            readable(path)
