"""Bad inputs that the rooms' own tests do not have: each is refused in one line."""

import re
from dataclasses import replace
from functools import cache

import numpy as np
import pandas as pd
import pytest
import torch

from sidegan.errors import SideganError
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.compose import composed
from sidegan.pipeline.stages.identify import checked
from sidegan.robot import load_robot, require_consistent

PLANAR = load_robot("planar2")
FAMILY = Trajectory(2, 3, 12.0)


def description(old, new):
    """Load planar2 with a part of its text replaced."""

    def act(folder):
        text = re.sub(old, new, PLANAR.urdf.read_text("utf-8"), count=1)
        (folder / "arm.urdf").write_text(text, "utf-8")
        require_consistent(load_robot(folder / "arm.urdf"))

    return act


@cache
def table():
    """A recording of planar2 that there is nothing to say against."""
    random = torch.Generator().manual_seed(1)
    c = 0.3 * torch.randn(1, *FAMILY.shape, generator=random, dtype=torch.float64)
    motion = FAMILY.roll_out(c, FAMILY.grid(1200))
    torque = RigidBody(PLANAR).torque(*motion[1:])[0]
    torque = torque + 0.01 * torch.randn(torque.shape, generator=random)
    rows = np.column_stack([motion.time, motion.position[0], torque])
    return pd.DataFrame(rows, columns=["t", "q1", "q2", "tau1", "tau2"])


def recording(change):
    """Check a recording: a table, or the arrays of an NPZ file."""

    def act(folder):
        changed, file = change(table()), folder / "a.csv"
        if isinstance(changed, dict):
            file = folder / "a.npz"
            np.savez(file, **{name: x.to_numpy() for name, x in table().items()} | changed)
        else:
            changed.to_csv(file, index=False)
        cfg = composed("+experiment=identify", "robot=planar2", "tracking=off")
        checked(replace(cfg, recordings=[str(file)]), PLANAR)

    return act


CASES = [
    ("'upper_arm': principal moments -5, 0.004, 0.045 kg·m²", description('ixx="[^"]*"', 'ixx="-5"')),
    ("joint 'shoulder' is of type '', expected revolute", description('type="revolute"', 'type=""')),
    ("a collision geometry of none, expected one of sphere", description(r"<sphere [^>]*/>", "")),
    ("arm.urdf is not well-formed XML", description("(?s)(.{900}).*", r"\1")),
    ("Could not determine home directory", lambda _: load_robot("~nobody_of_that_name/arm.urdf")),
    ("there is no URDF file", lambda folder: load_robot(folder / "a\0b.urdf")),
    ("a.csv holds 9 samples, expected 10 or more", recording(lambda x: x.iloc[:9])),
    ("too short to identify from", recording(lambda x: x.assign(t=x.t * 1e-300))),
    ("100% of its rows are without a number, in column t", recording(lambda x: x.assign(t="2026-01-01"))),
    ("75% of its rows are without a number, in column tau2", recording(lambda x: x.assign(tau2=x.tau2[::4]))),
    ("100% of its rows are without a number, in column q1", recording(lambda x: x.assign(q1=x.q1 * 1e300))),
    ("the torque of shoulder, elbow is constant", recording(lambda x: x.assign(tau1=1.0, tau2=2.0))),
    ("hardly moves: no joint by more than 0 rad or m", recording(lambda x: x.assign(q1=0.3, q2=0.1))),
    ("is not a whole npz file", recording(lambda x: {"q2": np.array([{}] * len(x))})),
    ("holds more than a number in each row", recording(lambda x: {"q2": np.zeros((len(x), 2, 2))})),
]


@pytest.mark.parametrize(("message", "act"), CASES, ids=[message for message, _ in CASES])
def test_is_refused_in_one_line(message, act, tmp_path):
    with pytest.raises(SideganError, match=re.escape(message)) as caught:
        act(tmp_path)
    assert len(str(caught.value).splitlines()) == 1
