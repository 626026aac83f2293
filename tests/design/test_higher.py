"""Seeds under limits of acceleration and jerk."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.robot import HIGHER
from sidegan.seeds import Gradient
from sidegan.seeds.paper import Paper
from sidegan.validity import Constraints, check
from tests.validity.critical import limited

BOTH = ["acceleration", "jerk"]


def tight(problem, names, share):
    """The same problem of an arm with limits of acceleration and jerk."""
    constraints = problem.constraints
    arm = limited(constraints.arm, names, share)
    return replace(problem, constraints=Constraints(arm, constraints.regions))


def shares(problem, c, name):
    """Largest share of a limit that each trajectory uses, (B,), at 4,000 samples."""
    times = problem.trajectory.grid(4000)
    x = problem.trajectory.derivative(c, times, HIGHER[name]).abs()
    return (x / problem.constraints.higher[name]).amax((1, 2))


@pytest.mark.parametrize("method", [Gradient(40, 5, reserve=0.05), Paper(6, 20, 200, box=0.5, attempts=5)])
def test_seeds_keep_the_limits_and_use_them(planar_problem, method):
    problem = tight(planar_problem, BOTH, 0.1)
    batch = method.optimise(problem, 3, np.random.SeedSequence(1))
    assert len(batch) == 3
    found = check(problem.constraints, problem.trajectory, batch.coefficients)
    assert found.valid.all() and {"acceleration", "jerk"} <= set(found.margins)
    most = torch.stack([shares(problem, batch.coefficients, one) for one in BOTH]).amax(0)
    assert (most <= 1).all() and most.max() > 0.8
    free = method.optimise(planar_problem, 3, np.random.SeedSequence(1))
    assert not check(problem.constraints, problem.trajectory, free.coefficients).valid.any()
