"""What the room refuses, and in which words."""

import os
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import pytest
import torch

from sidegan.errors import RobotError, ShapeError
from sidegan.motion.dynamics import RigidBody, gram
from sidegan.motion.trajectory import Motion, Trajectory, concatenate

NAN, INF = float("nan"), float("inf")


def states(*shapes):
    return [torch.zeros(shape, dtype=torch.float64) for shape in shapes]


@pytest.fixture(scope="module")
def room(arm, planar):
    """What the calls of the table are made of."""
    still = RigidBody(replace(planar, axis=torch.zeros(2, 3, dtype=torch.float64)))
    body, short, two, family = RigidBody(arm), Trajectory(7, 4, 8.0), RigidBody(planar), Trajectory(2)
    c, nothing, one = (torch.ones(count, *family.shape, dtype=torch.float64) for count in (3, 0, 1))
    whole, apart = family.roll_out(c, family.times(20)), torch.arange(3)[:, None, None]
    away, cells = whole._replace(position=whole.position + apart), family.roll_out(c, family.grid(10))
    empty, single = family.roll_out(nothing, family.times(1)), family.roll_out(one, torch.zeros(1))
    return SimpleNamespace(**locals())


def torque_of(*shapes):
    return lambda r: r.body.torque(*states(*shapes))


def family_of(**settings):
    return lambda r: Trajectory(**settings)


def roll_out_of(*shape, value=0.0):
    """Roll-out of coefficients, the last of which has a value."""

    def call(r):
        c = torch.zeros(shape)
        c[-1] = value
        r.family.roll_out(c, r.family.grid(3))

    return call


REFUSALS = [
    ("no inertial parameter of planar2", lambda r: r.still.base),
    ("expected", torque_of((4, 6), (4, 7), (4, 7))),
    ("expected", torque_of((4, 7), (5, 7), (4, 7))),
    ("expected", torque_of((4, 7), (4, 7), ())),
    ("expected", lambda r: r.body.regressor(*states((4, 7), (4, 7), (7,)))),
    (r"expected \(…, 2\)", lambda r: gram(r.two, r.short, *states((5, 7, 4, 2)))),
    ("at least one sample, got 0", lambda r: gram(r.body, r.short, *states((5, 7, 4, 2)), samples=0)),
    ("joints and harmonics must be positive, got 0", family_of(joints=0)),
    ("got 2 and 0", family_of(joints=2, harmonics=0)),
    ("period must be a positive number of seconds, got 0.0", family_of(joints=2, period=0.0)),
    ("got nan", family_of(joints=2, period=NAN)),
    ("got inf", family_of(joints=2, period=INF)),
    ("must be 2 finite joint positions", family_of(joints=2, home=[0.0])),
    ("nan", family_of(joints=2, home=[0.0, NAN])),
    *(
        (r"expected \(B, 2, 6, 2\)", roll_out_of(*shape))
        for shape in ((2, 6, 2), (1, 3, 6, 2), (1, 2, 5, 2), (1, 2, 6, 1), (1, 1, 2, 6, 2))
    ),
    *(("trajectory 2 are not finite", roll_out_of(3, 2, 6, 2, value=value)) for value in (NAN, INF, -INF)),
    *(
        (r"gives no sample in 16\.0 s", lambda r, rate=rate: r.family.times(rate))
        for rate in (0.0, -1.0, 0.01, NAN, INF)
    ),
    ("at least one sample, got 0", lambda r: r.family.grid(0)),
    *(
        (r"expected 0 to 16.0 s", lambda r, time=time: r.family.roll_out(r.c, torch.tensor([1.0, time])))
        for time in (-0.1, 16.1, NAN)
    ),
    ("begin and end at rest at one position", lambda r: concatenate(r.away)),
    ("begin and end at rest at one position", lambda r: concatenate(r.cells)),
    ("two samples or more", lambda r: concatenate(Motion(*r.empty))),
    ("two samples or more", lambda r: concatenate(Motion(*r.single))),
]


@pytest.mark.parametrize(("words", "call"), REFUSALS)
def test_refusals(room, words, call):
    with pytest.raises((ShapeError, RobotError), match=words):
        call(room)


def test_numba_is_not_imported_before_it_is_needed():
    code = "import sys, sidegan.pipeline.settings, sidegan.motion.dynamics; sys.exit('numba' in sys.modules)"
    assert subprocess.run([sys.executable, "-c", code], env={**os.environ}, check=False).returncode == 0
