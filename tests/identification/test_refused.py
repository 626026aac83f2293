"""What is refused, and the words that say why."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification import FULL, Measurements, estimate, exact_measurements, score
from sidegan.identification.goals import unmeasured
from sidegan.identification.payload import drive_gains
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from tests.identification.recordings import GOAL, Fixed, model_of, noisy_rows, recorded

ROWS = noisy_rows(60)
LINEAR = Fixed(ROWS[0])
DATA = LINEAR.measurements(ROWS[1])
PLANAR = load_robot("planar2")
MODEL = model_of(PLANAR)
PLANAR_DATA = recorded(MODEL, 200, noise=0.1)
STATE = np.zeros((4, 2))
FAMILY = Trajectory(2)
NOWHERE = np.zeros((0, *FAMILY.shape))


def of_rows(method, torque=ROWS[1], **settings):
    return estimate(method, LINEAR, LINEAR.measurements(torque), **settings)


def spoilt(value):
    torque = ROWS[1].copy()
    torque[5, 1] = value
    return torque


def measurements(**changes):
    fields = dict.fromkeys(("position", "velocity", "acceleration", "torque"), STATE)
    return Measurements(**fields | changes)


def measured_by(family, c):
    return exact_measurements(RigidBody(PLANAR), family.roll_out(c, family.times(10.0)))


def gains():
    return drive_gains(MODEL, [PLANAR_DATA], [PLANAR_DATA], np.zeros(10))


def goal(**changes):
    return unmeasured(RigidBody(PLANAR), FULL, replace(GOAL, **changes))


REFUSED = [
    (ConfigError, "'lasso', expected one of ols, weighted, consistent", lambda: of_rows("lasso")),
    (ShapeError, "no samples", lambda: estimate("ols", LINEAR, [DATA[:0]])),
    (ShapeError, "3 joints, the model has 2", lambda: estimate("ols", MODEL, DATA)),
    (ShapeError, "all torques are zero", lambda: of_rows("weighted", 0 * ROWS[1])),
    (ShapeError, "not finite or too large to square", lambda: of_rows("ols", spoilt(1e200))),
    (ShapeError, "torque of sample 5 is not finite", lambda: of_rows("ols", spoilt(np.nan))),
    (ShapeError, r"velocity is \(4, 3\)", lambda: measurements(velocity=np.zeros((4, 3)))),
    (ShapeError, "sign is", lambda: measurements(sign=STATE[:2])),
    (ShapeError, "nothing to measure", lambda: measured_by(FAMILY, NOWHERE)),
    (ShapeError, "expected .*2", lambda: measured_by(Trajectory(3), np.zeros((1, 3, 6, 2)))),
    (ShapeError, "no samples to test with", lambda: score(LINEAR, np.zeros(6), [])),
    (ShapeError, r"parameters are \(3,\)", lambda: score(LINEAR, np.zeros(3), DATA)),
    (ShapeError, r"of joints \[1, 2\] is constant", lambda: score(MODEL, MODEL.nominal, measurements())),
    (ShapeError, r"expected \(S, 2\)", lambda: MODEL.regressor(STATE[None], STATE[None], STATE[None])),
    (ConfigError, "the load has no effect on shoulder, elbow", gains),
    (ConfigError, r"names hand, expected some of .*forearm", lambda: goal(objective=["hand"])),
    (ConfigError, "expected some of .*forearm, or goal.objective=param", lambda: goal(objective=[])),
    (ConfigError, "goal.noise has 3 numbers, the arm has 2 joints", lambda: goal(noise=[1.0, 1.0, 1.0])),
]


@pytest.mark.parametrize(("error", "words", "use"), REFUSED, ids=[words for _, words, _ in REFUSED])
def test_is_refused(error, words, use):
    with pytest.raises(error, match=words):
        use()
