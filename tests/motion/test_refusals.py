"""What the room refuses."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from sidegan.errors import RobotError, ShapeError, SideganError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Trajectory, concatenate
from sidegan.robot import load_robot
from tests.refusals import refused

NAN, INF = float("nan"), float("inf")
FAMILY, SHORT, C = Trajectory(2), Trajectory(7, 4, 8.0), np.ones((3, 2, 6, 2))
PLANAR, LWR = (RigidBody(load_robot(name)) for name in ("planar2", "kuka_lwr4"))
STILL = RigidBody(replace(PLANAR.arm, axis=np.zeros((2, 3))))
WHOLE = FAMILY.roll_out(C, FAMILY.times(20))
AWAY = WHOLE._replace(position=WHOLE.position + np.arange(3)[:, None, None])


def states(*shapes):
    return [np.zeros(shape) for shape in shapes]


REFUSALS = [  # what the message names, and the call
    ("planar2", lambda: STILL.base),
    ("(4, 6)", partial(LWR.torque, *states((4, 6), (4, 7), (4, 7)))),
    ("(5, 7)", partial(LWR.torque, *states((4, 7), (5, 7), (4, 7)))),
    ("(7,)", partial(LWR.regressor, *states((4, 7), (4, 7), (7,)))),
    *(
        ("torque", partial(LWR.sums, *states(*3 * [(4, 7)], x)))
        for x in ((4, 6), (4, 8), (3, 7), (5, 7), (28,))
    ),
    ("(2, 4, 7)", partial(LWR.sums, *states(*4 * [(2, 4, 7)]))),
    *(
        ("certainty", partial(gram, LWR, Trajectory(7), np.zeros((1, 7, 6, 2)), certainty=np.ones(x)))
        for x in (6, 8, (1, 7))
    ),
    ("velocity", partial(PLANAR.drive_torque, [0, 0], ["a", "b"], [0, 0])),
    ("2", partial(gram, PLANAR, SHORT, *states((5, 7, 4, 2)))),
    *(("joints", partial(Trajectory, joints)) for joints in (0, 2.5, "2")),
    *(("harmonics", partial(Trajectory, 2, harmonics)) for harmonics in (0, 6.0, None)),
    *(("period", partial(Trajectory, 2, 6, period)) for period in (0.0, NAN, INF, "8")),
    *(("home", partial(Trajectory, 2, home=home)) for home in ([0.0], [0.0, NAN], 0.3, ["a", 1], [[0, 0]])),
    *(
        (f"{shape}", partial(FAMILY.roll_out, np.zeros(shape), FAMILY.grid(3)))
        for shape in ((2, 6, 2), (1, 3, 6, 2), (1, 2, 5, 2), (1, 2, 6, 1), (1, 1, 2, 6, 2))
    ),
    *(
        ("coefficients[2]", partial(FAMILY.roll_out, last * C, FAMILY.grid(3)))
        for last in np.reshape([[1, 1, NAN], [1, 1, INF], [1, 1, -INF]], (3, 3, 1, 1, 1))
    ),
    *(
        (f"rate is {rate!r}", partial(FAMILY.times, rate))
        for rate in (0.0, -1.0, 0.01, 1e12, 1e308, NAN, INF, -INF, "100", None, [100])
    ),
    ("0", partial(FAMILY.grid, 0)),
    *(("16.0 s", partial(FAMILY.roll_out, C, np.array([1.0, time]))) for time in (-0.1, 16.1, NAN)),
    ("Trajectory.times", partial(concatenate, AWAY)),
    ("Trajectory.times", partial(concatenate, FAMILY.roll_out(C, FAMILY.grid(10)))),
    ("0 of 17", partial(concatenate, FAMILY.roll_out(C[:0], FAMILY.times(1)))),
    ("1 of 1", partial(concatenate, FAMILY.roll_out(C[:1], np.zeros(1)))),
]


@pytest.mark.parametrize(("about", "call"), REFUSALS)
def test_invalid_input_is_refused(about, call):
    with refused(SideganError, about) as caught:
        call()
    assert isinstance(caught.value, ShapeError | RobotError)
