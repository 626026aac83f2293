"""Settings of an arm as words on a command line: what is printed is what must be typed."""

import shlex

import pytest

from sidegan.errors import ConfigError
from sidegan.pipeline.settings import validate
from sidegan.robot import Limits, Setup
from sidegan.robot.setup import words
from tests.tiny import composed

SETUPS = {
    "nothing": Setup(),
    "part": Setup(base="torso_link", tip="left/hand", locked={"finger_joint": 0.02, "torso": -1.5}),
    "args": Setup(args={"ur_type": "ur5e", "prefix": "a b"}),
    "files": Setup(limits_file="/path/to my/limits.yaml", srdf="arm.srdf", shapes="shapes.npz", home="ready"),
    "numbers": Setup(pieces=3, finer=8, srdf_pairs=True),
    "pairs": Setup(may_touch=[("link_5", "link_7"), ("a", "b")]),
    "limits": Setup(limits=Limits(velocity={"j": 1.5}, position={"j": (-1.0, 2.0)}, effort={"k": 3.0})),
}


def test_arguments_of_a_xacro_file_may_be_numbers():
    typed = ["robot.args={length: 0.2, count: 3, gripper: true}"]
    robot = validate(composed("+experiment=excite", "robot=planar2", *typed)).robot
    assert robot.setup.args == {"length": "0.2", "count": "3", "gripper": "true"}


@pytest.mark.parametrize("region", ["{spere: {radius: 1}}", "{sphere: {center: [0, 0, 1], radius: 0.1}}"])
def test_a_misspelt_part_of_a_region_is_looked_for_among_its_own(region):
    meant = "sphere" if "spere" in region else "sphere.centre"
    with pytest.raises(ConfigError, match=rf"did you mean workspace\.regions\[0\]\.{meant}\?"):
        validate(composed("+experiment=excite", "robot=planar2", f"workspace.regions=[{region}]"))


@pytest.mark.parametrize("setup", SETUPS.values(), ids=SETUPS)
def test_words_give_the_setup_back(setup):
    typed = shlex.split(" ".join(words(setup)))
    assert validate(composed("+experiment=excite", "robot=planar2", *typed)).robot.setup == setup
