"""What is refused."""

from dataclasses import replace

import numpy as np
import pytest

from sidegan.errors import ConfigError, ShapeError
from sidegan.identification import FULL, Measurements, estimate, exact_measurements, score
from sidegan.identification.goals import uncertainty_of_description
from sidegan.identification.payload import drive_gains
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import load_robot
from tests.identification.recordings import GOAL, Fixed, model_of, noisy_rows, recorded
from tests.refusals import refused

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
    return uncertainty_of_description(RigidBody(PLANAR), FULL, replace(GOAL, **changes))


# Kind of error, what it names, and what is refused.
REFUSED = {
    "an unknown method": (ConfigError, "lasso", "weighted", lambda: of_rows("lasso")),
    "nothing": (ShapeError, "samples", lambda: estimate("ols", LINEAR, [DATA[:0]])),
    "another arm": (ShapeError, "3 joints", "2", lambda: estimate("ols", MODEL, DATA)),
    "no torques": (ShapeError, "torques", "zero", lambda: of_rows("weighted", 0 * ROWS[1])),
    "large torques": (ShapeError, "too large", lambda: of_rows("ols", spoilt(1e200))),
    "no number": (ShapeError, "torque", "sample 5", lambda: of_rows("ols", spoilt(np.nan))),
    "a velocity": (ShapeError, "velocity", "(4, 3)", lambda: measurements(velocity=np.zeros((4, 3)))),
    "a sign": (ShapeError, "sign", "(2, 2)", lambda: measurements(sign=STATE[:2])),
    "no motion": (ShapeError, "nothing", lambda: measured_by(FAMILY, NOWHERE)),
    "a motion": (ShapeError, "3", "2", lambda: measured_by(Trajectory(3), np.zeros((1, 3, 6, 2)))),
    "no test": (ShapeError, "samples", "test", lambda: score(LINEAR, np.zeros(6), [])),
    "parameters": (ShapeError, "(3,)", "6", lambda: score(LINEAR, np.zeros(3), DATA)),
    "constants": (ShapeError, "[1, 2]", lambda: score(MODEL, MODEL.nominal, measurements())),
    "a batch": (ShapeError, "(1, 4, 2)", lambda: MODEL.regressor(STATE[None], STATE[None], STATE[None])),
    "no load": (ConfigError, "shoulder, elbow", gains),
    "an unknown link": (ConfigError, "hand", "forearm", lambda: goal(objective=["hand"])),
    "no link": (ConfigError, "goal.objective=parameters", "forearm", lambda: goal(objective=[])),
    "much noise": (ConfigError, "goal.noise", "3", "2", lambda: goal(noise=[1.0, 1.0, 1.0])),
}


@pytest.mark.parametrize("case", REFUSED)
def test_is_refused(case):
    kind, *about, use = REFUSED[case]
    with refused(kind, *about):
        use()
