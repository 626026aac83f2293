"""What is compiled beside a search: what every arm's proof needs, once, and by one process."""

import subprocess

import pytest
from numba import typeof

from sidegan.design import beside
from sidegan.design.objective import Goal, Objective
from sidegan.design.precompile import compile_kernels
from sidegan.design.problem import Problem, SearchSettings
from sidegan.design.search import search
from sidegan.kernels import goals, objective
from sidegan.kernels.descent import descend
from sidegan.kernels.proof import visit
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, check
from tests.validity.critical import BALL, BOX, HULL, drawn


def test_kernels_compiled_for_the_planar_arm_serve_every_arm(arm):
    compile_kernels()
    family = Trajectory(7)
    for regions in ([], [BOX, BALL, HULL]):
        for size in (0.01, 0.03, 0.1):  # some of which are looked at in finer cells
            check(Constraints(arm, regions), family, size * drawn(family, 8))
    search(Problem(Constraints(arm), family), Goal(), SearchSettings(evaluations=10, patience=10))
    assert len(visit._compiled.signatures) == len(descend._compiled.signatures) == 1
    of_arm = Objective(Problem(Constraints(arm), family), Goal("variance"))
    plan, work = of_arm.plan, of_arm.scratch
    for part, arguments in (
        (goals.goal_of, (plan.goal, plan.subspace, work.gram[0], work.goal)),
        (objective.slopes, (plan, 1, work)),
    ):
        assert part.inner.signatures == [tuple(map(typeof, arguments))], part


@pytest.mark.parametrize(("open_", "processes", "started"), [(True, 2, 1), (True, 1, 0), (False, 2, 0)])
def test_compilation_starts_once_if_a_core_is_free_and_it_is_not_done(open_, processes, started, monkeypatch):
    calls = []
    monkeypatch.setattr(subprocess, "Popen", lambda command, **_: calls.append(command))
    monkeypatch.setattr(beside, "worker_count", lambda _: processes)
    monkeypatch.setattr(type(visit), "to_be_compiled", lambda self: open_)
    beside.compile_beside.cache_clear()
    beside.compile_beside()
    beside.compile_beside()
    assert len(calls) == started
