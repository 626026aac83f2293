"""The benchmark of acceleration limits, on the planar arm: slowed down trajectories just fit."""

import pytest
import torch

from benchmarks import limits
from sidegan.design.problem import Problem
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import HIGHER
from sidegan.validity import Constraints, check

ABOUT = {"acceleration": [0.8, 1.2], "jerk": [3.0, 6.0]}


@pytest.fixture(scope="module")
def arm():
    return limits.limited("planar2", ABOUT)


def test_what_is_slowed_down_just_fits(arm):
    problem = Problem(Constraints(arm), Trajectory(2, 3, 8.0), 24)
    c = (
        problem.start(6, torch.Generator().manual_seed(0), 0.3)
        * torch.tensor([0.2, 1, 2, 4, 6, 9])[:, None, None, None].double()
    )
    slower = limits.slow_down(problem, c)
    assert slower.stretch[0] == 1 and (slower.stretch[3:] > 1).all()
    for one, s in zip(c, slower.stretch.tolist()):
        family = Trajectory(2, 3, 8.0 * s)
        margins = check(Constraints(arm), family, one[None] / s).margins
        times = family.times(2000.0 / s)
        uses = [
            float((family.derivative(one[None] / s, times, HIGHER[name]).abs() / limit).max())
            for name, limit in arm.higher_limits.items()
        ]
        assert all(float(margins[name]) >= -1e-4 for name in HIGHER) and max(uses) <= 1
        assert s == 1 or max(uses) > 1 - 1e-4


def test_a_row_says_what_limits_cost(arm):
    row = limits.compare(arm, 6, 60)
    assert row["ours"] < row["slowed down"] and row["exceed"] > 0 and row["slower by"] > 1
    shown = limits.table([{"arm": "planar2", **row}, {"arm": "none", "stated": "is not there"}])
    assert shown.loc["planar2", "exceed"].endswith("%") and shown.loc["none", "stated"] == "is not there"


def test_an_arm_that_is_not_there_is_said_and_a_wrong_word_refused(capsys, monkeypatch):
    monkeypatch.setattr(limits, "ARMS", {"panda": {"name": "nobody", "acceleration": [1.0]}})
    assert limits.main(["--count", "2"]) == 1
    assert "no robot named 'nobody'" in " ".join(capsys.readouterr().out.replace("│", " ").split())
    with pytest.raises(SystemExit):
        limits.main(["robot=x.urdf"])
