"""Settings of an arm as words on a command line: what is printed is what must be typed."""

import shlex

import pytest

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


@pytest.mark.parametrize("setup", SETUPS.values(), ids=SETUPS)
def test_words_give_the_setup_back(setup):
    typed = shlex.split(" ".join(words(setup)))
    assert validate(composed("+experiment=excite", "robot=planar2", *typed)).robot.setup == setup
