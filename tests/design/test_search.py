"""What a search answers: proven by another author's physics, the same again, in time, or why not."""

from dataclasses import replace
from functools import cache
from itertools import count

import coal
import numpy as np
import pinocchio as pin
import pytest

from sidegan.design import search as design_search
from sidegan.design.objective import Goal
from sidegan.design.problem import Problem, SearchSettings
from sidegan.design.search import ConditionGoal, Found, design_set, prove, search
from sidegan.errors import InfeasibleError, ShapeError
from sidegan.identification import TorqueModel
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory
from sidegan.robot import DERIVATIVE_ORDER as ORDERS
from sidegan.validity import Constraints, Plane, check
from tests.oracle import capsule_geometry, chain_model
from tests.refusals import refused

from .conftest import CASES

SETTINGS = SearchSettings(evaluations=60, patience=60)
ORACLE = [case for case in CASES if case not in ("bodies", "pieces", "pieces apart")]


@pytest.fixture(scope="session")
def problem_of(arm):
    """The problem of a case."""
    return cache(lambda name: Problem(*CASES[name](arm), samples=40))


def searched(problem, goal=None, evaluations=60, **options):
    return search(problem, goal or Goal(), replace(SETTINGS, evaluations=evaluations), **options)


def assert_valid(problem, c):
    found = check(problem.constraints, problem.trajectory, c[None])
    assert bool(found.valid[0]), found.failures(0)


def scene(constraints):
    """The capsules of an arm and what is around them as Pinocchio's geometry, with all pairs that count."""
    geometry, pairs = capsule_geometry(constraints.arm), constraints.pairs.tolist()
    capsules = len(geometry.geometryObjects)
    for region in constraints.regions:
        if isinstance(region, Plane):
            shape, place = coal.Halfspace(np.array(region.unit), region.offset), pin.SE3.Identity()
        else:
            low, high = np.array(region.lower), np.array(region.upper)
            shape, place = coal.Box(*(high - low)), pin.SE3(np.eye(3), (low + high) / 2)
        geometry.addGeometryObject(pin.GeometryObject("region", 0, place, shape))
    pairs += [(capsule, capsules + region) for region, capsule in constraints.guarded.tolist()]
    for pair in pairs:
        geometry.addCollisionPair(pin.CollisionPair(*pair))
    return geometry


@pytest.mark.parametrize("case", ORACLE)
def test_every_answer_is_valid_by_pinocchio_and_coal(problem_of, case):
    problem = problem_of(case)
    constraints, trajectory = problem.constraints, problem.trajectory
    c = searched(problem).coefficients[None]
    arm, used = constraints.arm, []
    q, dq, ddq = (x[0] for x in trajectory.roll_out(c, trajectory.times(100.0))[1:])
    np.testing.assert_allclose(q[[0, -1]], [trajectory.home] * 2, atol=1e-9)
    assert (q >= arm.position_lower).all() and (q <= arm.position_upper).all()
    assert (np.abs(dq) <= arm.velocity_limit).all()
    for name, limit in constraints.higher.items():
        states = trajectory.derivative(c, trajectory.times(1000.0), ORDERS[name])
        used.append(float((np.abs(states) / limit).max()))
    if used:
        assert 0.3 < max(used) <= 1  # they are what holds it back
    model, geometry = chain_model(arm), scene(constraints)
    data, shapes = model.createData(), geometry.createData()
    for k in range(len(q)):
        torque = pin.rnea(model, data, q[k], dq[k], ddq[k])
        if (drives := arm.drives) is not None:
            viscous, coulomb, rotor = (x for x in vars(drives).values())
            torque += viscous * dq[k] + coulomb * np.sign(dq[k]) + rotor * ddq[k]
        torque = np.abs(torque)
        if constraints.torque:
            assert (torque <= arm.torque_limit).all()
        pin.computeDistances(model, data, geometry, shapes, q[k])
        assert min(x.min_distance for x in shapes.distanceResults) >= -1e-6


@pytest.mark.parametrize("evaluations", [1, 7])
@pytest.mark.parametrize("case", ["desk", "bodies", "pieces", "pieces apart"])
def test_the_shortest_search_returns_a_valid_trajectory(problem_of, case, evaluations):
    assert_valid(problem_of(case), searched(problem_of(case), evaluations=evaluations).coefficients)


def test_more_starts_are_never_worse_and_results_repeat(problem_of):
    problem = problem_of("desk")
    short, other, again = (searched(problem, evaluations=n) for n in (60, 180, 180))
    assert other.value <= short.value
    assert np.array_equal(other.coefficients, again.coefficients)
    assert problem.fitness(other.coefficients[None])[0] < 400


def test_a_small_penalty_first_helps_short_searches(problem_of, monkeypatch):
    """Most starts end at a lower condition number than with the large penalty alone."""
    gains = []
    for case in ("no torque", "walls", "acceleration", "friction"):
        for seed in range(10):
            values = []
            for rough in (design_search._ROUGH, design_search._STRICT):
                with monkeypatch.context() as patched:
                    patched.setattr(design_search, "_ROUGH", rough)
                    values.append(searched(problem_of(case), evaluations=45, seed=seed).value)
            gains.append(values[1] - values[0])  # of log condition numbers
    assert np.mean(np.array(gains) > 0) > 0.6 and np.median(gains) > 0.03


def test_a_deadline_is_kept_and_the_best_so_far_returned(problem_of, monkeypatch):
    problem, reads = problem_of("box"), count()
    monkeypatch.setattr(design_search, "clock", lambda: 1e-3 * next(reads))
    for deadline in (0.1, 0.3):
        before = next(reads)
        found = searched(problem, deadline=deadline)
        assert 1e-3 * (next(reads) - before) <= deadline + 10 * 1e-3  # ten looks at the clock
        assert_valid(problem, found.coefficients)
    monkeypatch.setattr(design_search, "clock", lambda: 1.0 * next(reads))
    with refused(InfeasibleError, "2 evaluations", "out of time"):
        searched(problem, deadline=1e-3)


@pytest.mark.parametrize("gap", [0.0005, 0.003])
@pytest.mark.parametrize("evaluations", [6, 12])
def test_a_home_close_to_a_wall_still_gets_a_trajectory(planar, gap, evaluations):
    """A wall so close to home that any motion is in the reserve that is kept elsewhere."""
    home, wall = (0.3, 0.4), Plane((1.0, 0.0, 0.0), -5.0)
    rest = np.array([home])
    apart = float(Constraints(planar, [wall]).at_rest(rest)["keep_out"].min())
    near = Constraints(planar, [replace(wall, offset=wall.offset + apart - gap)])
    problem = Problem(near, Trajectory(2, 3, 8.0, home))
    c = searched(problem, evaluations=evaluations).coefficients
    assert_valid(problem, c)
    assert np.abs(c).max() > 0.02


def test_a_home_that_is_not_feasible_is_refused(arm):
    home = [0, 0, 0, 2.5, 0, 0, 0]
    with refused(InfeasibleError, "home", "position of joint_4"):
        searched(Problem(Constraints(arm), Trajectory(7, home=home)))


def test_a_constraint_that_no_motion_keeps_is_reported(planar, monkeypatch):
    problem = Problem(Constraints(planar), Trajectory(2, 3, 8.0))
    still = replace(planar, velocity_limit=0 * planar.velocity_limit)
    monkeypatch.setattr(
        "sidegan.design.search.check", lambda _, trajectory, c: check(Constraints(still), trajectory, c)
    )
    for work in (searched, lambda problem: design_set(problem, Taken(), 2, SETTINGS, 0)):
        with refused(InfeasibleError, "60 evaluations", "velocity of ", "home", "effort="):
            work(problem)


def test_a_set_is_designed_greedily(problem_of):
    problem = problem_of("desk")
    c = design_set(problem, ConditionGoal(problem), 3, SETTINGS, seed=0)
    for trajectory in c:
        assert_valid(problem, trajectory)
    assert np.array_equal(c[0], search(problem, Goal(), SETTINGS, 0).coefficients)
    grams = problem.gram(c)
    subspace = problem.body.base.subspace
    condition = [float(np.linalg.cond(subspace.T @ x @ subspace)) for x in (grams.sum(0), *grams)]
    assert condition[0] < min(condition[1:])


class Taken:
    """A goal that keeps what it takes."""

    def __init__(self):
        self.taken, self.told = [], []

    def next(self):
        self.told.append(len(self.taken))
        return Goal()

    def take(self, trajectory, c):
        self.taken.append(c)


NEVER = "velocity of elbow"
SETS = [  # scale of each trajectory, None if none is proven; which are in the set; how many are tiny, missing
    ([1, 0.6, 1, 1], [0, 1, 2, 3], []),
    ([1, 0.02, 1, 0.1], [0, 2], [2]),
    ([0.02, 1, 1, 1], [1, 2, 3], [1]),
    ([1, None, None, 1], [0, 3], [2]),
    ([1, 0.02, None, 1], [0, 3], [1, 1]),
    ([0.02, 0.1, 0.02, 0.1], [0, 1, 2, 3], []),
    ([0.02, None, 0.02, 0.1], [0, 2, 3], [1]),
]


@pytest.mark.parametrize(("shares", "kept", "said"), SETS)
def test_a_set_is_what_its_goal_took_and_what_it_lacks_is_said(
    planar_problem, monkeypatch, caplog, shares, kept, said
):
    c = planar_problem.start(len(shares), np.random.default_rng(0), 0.1)

    def found(problem, goal, settings, seed):
        if (share := shares[seed % len(shares)]) is None:
            raise InfeasibleError(NEVER)
        return Found(c[seed % len(shares)], 0.0, share)

    monkeypatch.setattr(design_search, "search", found)
    goal = Taken()
    chosen = design_set(planar_problem, goal, len(shares), SETTINGS, 0)
    assert np.array_equal(chosen, c[kept]) and np.array_equal(goal.taken, chosen)
    for text, number in zip(caplog.messages, said, strict=True):
        assert f"{number} of {len(shares)}" in text
    assert (NEVER in caplog.text) == (None in shares)


def test_no_trajectories_are_proven_at_once(planar_problem):
    c, valid, verdict = prove(planar_problem, planar_problem.start(2, np.random.default_rng(0))[:0], 0.5)
    assert c.shape == (0, 2, 3, 2) and valid.shape == verdict.valid.shape == (0,) and not verdict.faults()


@pytest.mark.parametrize(
    "goal",
    [
        lambda model, other: Goal("volume", prior=np.eye(3), targets=np.eye(43)),
        lambda model, other: Goal("volume", np.eye(43), model=model),
        lambda model, other: Goal(prior=np.full((43, 43), np.nan)),
        lambda model, other: Goal("variance", targets=np.eye(42)),
        lambda model, other: Goal("tool", targets=np.eye(43), tool_prior=np.eye(3)),
        lambda model, other: Goal(certainty=np.ones(6)),
        lambda model, other: Goal("volume", model=other),
    ],
)
def test_a_goal_that_does_not_fit_is_refused(problem_of, planar, goal):
    problem = problem_of("desk")
    with refused(ShapeError):
        searched(problem, goal(TorqueModel(problem.body), TorqueModel(RigidBody(planar))))
