"""What is refused, and the words that say why."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import ConfigError, InfeasibleError, RobotError, ShapeError
from sidegan.plant import IDEAL, Plant, mujoco_model
from tests.plant.conftest import motions


def weak(arm):
    return replace(arm, torque_limit=np.array([200.0, 1.0]))


def links(*changes):
    """Change link parameters of an arm: link, parameter and factor."""

    def change(arm):
        parameters = arm.inertial_parameters.copy()
        for link, parameter, factor in changes:
            parameters[link, parameter] *= factor
        return replace(arm, inertial_parameters=parameters)

    return change


def not_finite(motion):
    motion.velocity[0, 5, 1] = np.nan
    return motion


def same(x):
    return x


FOLLOWS_NOT = r"'elbow' does not follow: after 0\.\d+ s .* 0.1 rad .* limit of 1 N·m"
LOOSE = {"bandwidth": [0.2], "feed_forward": 0.0, "tolerance": 0.01}
THIN, LIGHT = links((0, slice(4, 10), 0.1)), links((slice(None), slice(None), 1e-17))
MANY = r"plant.viscous has 3 values, expected 2 \(one per joint\) or one"
EXECUTED = [  # the error, its words, and what is changed of arm, motion, rate [Hz] and settings
    (InfeasibleError, FOLLOWS_NOT, weak, same, 1000.0, {}),
    (InfeasibleError, "0.01 rad off its reference$", same, same, 1000.0, LOOSE),
    (InfeasibleError, "does not follow", same, same, 1000.0, {"bandwidth": [800.0], "damping_ratio": [0.05]}),
    (RobotError, "'upper_arm': .* too far out for its inertia", THIN, same, 1000.0, {}),
    (RobotError, "MuJoCo refuses planar2", LIGHT, same, 1000.0, {}),
    (ShapeError, r"0\.01 s, expected 0\.001 s: the plant runs at 1000 Hz", same, same, 100.0, {}),
    (ShapeError, "velocity of the motion is not finite", same, not_finite, 1000.0, {}),
    (ConfigError, MANY, same, same, 1000.0, {"viscous": [0.1] * 3}),
]


@pytest.mark.parametrize(("error", "words", "make", "change", "rate", "settings"), EXECUTED)
def test_invalid_executions_are_refused(planar, error, words, make, change, rate, settings):
    motion = change(motions(planar, rate=rate))
    with pytest.raises(error, match=words):
        Plant(make(planar), replace(IDEAL, **settings)).follow(motion)


def test_a_motion_of_another_arm_is_refused(arm, planar):
    with pytest.raises(ShapeError, match=r"position is \(1, 4001, 2\), expected \(B, 4001, 7\)"):
        Plant(arm, IDEAL).follow(motions(planar))


def test_impossible_links_are_named(arm):
    with pytest.raises(RobotError, match=r"link 'link_2': its mass is 0 kg.*link 'link_5': its mass is -"):
        mujoco_model(links((1, 0, 0.0), (4, 0, -1.0))(arm))
