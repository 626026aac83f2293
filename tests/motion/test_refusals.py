"""What the room refuses, and in which words."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sidegan.errors import RobotError, ShapeError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory, concatenate
from sidegan.robot import load_robot

NAN, INF = float("nan"), float("inf")
FAMILY, SHORT, C = Trajectory(2), Trajectory(7, 4, 8.0), np.ones((3, 2, 6, 2))
PLANAR, LWR = (RigidBody(load_robot(name)) for name in ("planar2", "kuka_lwr4"))
STILL = RigidBody(replace(PLANAR.arm, axis=np.zeros((2, 3))))
WHOLE = FAMILY.roll_out(C, FAMILY.times(20))
AWAY = WHOLE._replace(position=WHOLE.position + np.arange(3)[:, None, None])


def states(*shapes):
    return [np.zeros(shape) for shape in shapes]


REFUSALS = [
    ("no inertial parameter of planar2", lambda: STILL.base),
    ("expected", partial(LWR.torque, *states((4, 6), (4, 7), (4, 7)))),
    ("expected", partial(LWR.torque, *states((4, 7), (5, 7), (4, 7)))),
    ("expected", partial(LWR.regressor, *states((4, 7), (4, 7), (7,)))),
    (r"expected \(…, 2\)", partial(gram, PLANAR, SHORT, *states((5, 7, 4, 2)))),
    ("joints and harmonics must be positive, got 0", partial(Trajectory, 0)),
    ("got 2 and 0", partial(Trajectory, 2, 0)),
    *(
        (f"positive number of seconds, got {period}", partial(Trajectory, 2, 6, period))
        for period in (0.0, NAN, INF)
    ),
    ("must be 2 finite joint positions", partial(Trajectory, 2, home=[0.0])),
    ("nan", partial(Trajectory, 2, home=[0.0, NAN])),
    *(
        (r"expected \(B, 2, 6, 2\)", partial(FAMILY.roll_out, np.zeros(shape), FAMILY.grid(3)))
        for shape in ((2, 6, 2), (1, 3, 6, 2), (1, 2, 5, 2), (1, 2, 6, 1), (1, 1, 2, 6, 2))
    ),
    *(
        (r"coefficients\[2\] are not finite", partial(FAMILY.roll_out, last * C, FAMILY.grid(3)))
        for last in np.reshape([[1, 1, NAN], [1, 1, INF], [1, 1, -INF]], (3, 3, 1, 1, 1))
    ),
    *(
        (r"rate is .*, expected 1 to 10,000,000 samples in 16\.0 s", partial(FAMILY.times, rate))
        for rate in (0.0, -1.0, 0.01, 1e12, 1e308, NAN, INF, -INF, "100", None, [100])
    ),
    ("velocity: expected an array of numbers", partial(PLANAR.drive_torque, [0, 0], ["a", "b"], [0, 0])),
    ("at least one sample, got 0", partial(FAMILY.grid, 0)),
    *(
        (r"expected 0 to 16.0 s", partial(FAMILY.roll_out, C, np.array([1.0, time])))
        for time in (-0.1, 16.1, NAN)
    ),
    ("begin and end at rest at one position", partial(concatenate, AWAY)),
    ("begin and end at rest at one position", partial(concatenate, FAMILY.roll_out(C, FAMILY.grid(10)))),
    ("two samples or more", partial(concatenate, FAMILY.roll_out(C[:0], FAMILY.times(1)))),
    ("two samples or more", partial(concatenate, FAMILY.roll_out(C[:1], np.zeros(1)))),
]


@pytest.mark.parametrize(("words", "call"), REFUSALS)
def test_invalid_input_is_refused(words, call):
    with pytest.raises((ShapeError, RobotError), match=words):
        call()
