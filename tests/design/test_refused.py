"""What the room refuses, each by the words that tell what was expected."""

import math

import pytest
import torch

from sidegan.base.typed import build
from sidegan.design.criteria import criteria_of, variance
from sidegan.design.excitation import effective_rank, excite, mean_distance, nearest_distance
from sidegan.design.greedy import greedy
from sidegan.design.information import Information, information_of
from sidegan.design.objectives import Term
from sidegan.design.optimal import a_optimal, ceiling, d_optimal
from sidegan.design.physics import SetInformation, spectrum
from sidegan.design.selection import Selection
from sidegan.errors import ConfigError, ShapeError
from sidegan.motion.dynamics import RigidBody

from .conftest import semidefinite, trajectories

NAN = math.nan
SIX, NONE = Information.of(semidefinite(0, 6)), Information(torch.ones(0, 10))
FLAT = Information.of(torch.diag_embed(torch.tensor([[1.0, 2.0, 0.0, 1.0]] * 6, dtype=torch.float64)))
SKEW = torch.eye(4, dtype=torch.float64) + torch.tensor([0.0, 0.01, 0.0, 0.0])


def spoilt(shape, where, value):
    x = torch.ones(shape)
    x[where] = value
    return x


MATRICES = [
    *((lambda x=x: criteria_of(x), r"expected \(q, q\)") for x in map(torch.ones, [(3,), (2, 3), (0, 0)])),
    (lambda: criteria_of(torch.full((2, 2), NAN)), "not finite"),
    *((lambda x=x: variance(x), "target is") for x in (torch.ones(3), torch.ones(2, 3))),
    (lambda: variance(torch.full((2, 2), math.inf)), "target is"),
    (lambda: variance(-torch.eye(2)), "semidefinite"),
    (lambda: variance(torch.zeros(2, 2)), "semidefinite"),
    (lambda: variance(torch.tensor([[1.0, 0.5], [0.0, 1.0]])), "semidefinite"),
    (lambda: variance(torch.eye(3)).value(semidefinite(0)), "3 parameters for information on 4"),
    (lambda: variance(torch.eye(3)).tangent(semidefinite(0)[0]), "3 parameters for information on 4"),
    *(
        (lambda shape=shape: Information.of(torch.ones(shape)), r"expected \(N, q, q\)")
        for shape in [(3, 3), (2, 3, 4), (2, 0, 0)]
    ),
    *(
        (lambda x=x: Information(x), r"q \+ 1")
        for x in (torch.ones(3), torch.ones(3, 5), torch.ones(3, 0), torch.ones(2, 3).int())
    ),
    *(
        (lambda x=x: Information.of(spoilt((5, 4, 4), 2, x)), "information of trajectory 2 is not finite")
        for x in (NAN, math.inf)
    ),
    *(
        (lambda x=x: SIX.stacked(torch.tensor(x)), "indices are")
        for x in ([], [6], [-1], [0.5], [True], [[1]])
    ),
    (lambda: Information(torch.ones(0, 6)).prior(), "no trajectories"),
    (lambda: Information.of(semidefinite(0, 1, rank=3)).prior(), "no trajectory excites some direction"),
]
PICKS = [
    *((lambda n=n: d_optimal(SIX, n), f"{n} of 6") for n in (0, -1, 7)),
    *((lambda n=n: a_optimal(SIX, n), f"{n} of 6") for n in (0, -1, 7)),
    *((lambda pick=pick: pick(NONE, 1), "of 0") for pick in (d_optimal, a_optimal)),
    *(
        (lambda x=x, work=work: work(x), "prior is")
        for x in (torch.eye(3), torch.ones(4), -torch.eye(4), torch.zeros(4, 4), NAN * torch.eye(4))
        for work in (
            lambda x: d_optimal(SIX, 2, x),
            lambda x: a_optimal(SIX, 2, x),
            lambda x: ceiling(SIX, torch.arange(2), prior=x),
        )
    ),
    (lambda: d_optimal(SIX, 2, SKEW), "symmetric"),
    (lambda: d_optimal(FLAT, 2), "give a prior"),
    *(
        (lambda x=x: ceiling(SIX, torch.tensor(x)), "indices are")
        for x in ([], [0, 6], [-1], [1, 1], [0.0, 1.0])
    ),
    (lambda: a_optimal(SIX, 2, target=torch.eye(3)), "target of 3"),
    *((lambda n=n: greedy(torch.ones(3, 2), n), f"{n} of 3") for n in (0, -1, 4)),
    *((lambda x=x: greedy(torch.ones(x), 1), r"\(N, p\)") for x in [(3,), (3, 2, 2), (3, 0)]),
    *((lambda x=x: greedy(spoilt((4, 2), (2, 1), x), 2), "trajectory 2") for x in (NAN, math.inf, -1e-3)),
    (lambda: greedy(torch.ones(0, 2), 1), "of 0"),
    *(
        (lambda measure=measure: measure(torch.zeros(1, 7, 6, 2)), "at least 2 rows, got 1")
        for measure in (mean_distance, nearest_distance, effective_rank)
    ),
]


@pytest.mark.parametrize(("work", "words"), [*MATRICES, *PICKS])
def test_numbers_that_cannot_be_are_refused(work, words):
    with pytest.raises(ShapeError, match=words):
        work()


@pytest.mark.parametrize("measure", [excite, information_of])
def test_coefficients_that_cannot_be_are_refused(planar, measure):
    body, (trajectory, c) = RigidBody(planar), trajectories(2)
    for wrong, words in ((c[0], "coefficients are"), (spoilt(c.shape, 3, NAN), "trajectory 3")):
        with pytest.raises(ShapeError, match=words):
            measure(body, trajectory, wrong)
    with pytest.raises(ShapeError, match=r"expected \(…, 2\)"):
        measure(body, *trajectories(7))


@pytest.mark.parametrize(
    ("deviation", "words"),
    [
        *((torch.tensor([1.0, x]), "finite and positive") for x in (0.0, -2.0, NAN, math.inf)),
        *((torch.ones(x), r"expected \(2,\) or \(6, 2\)") for x in [(), (1,), (3,), (5, 2), (6, 1)]),
    ],
)
def test_deviations_that_cannot_be_are_refused(planar, deviation, words):
    with pytest.raises(ShapeError, match=words):
        information_of(RigidBody(planar), *trajectories(2), deviation=deviation)


@pytest.mark.parametrize(
    ("make", "words"),
    [
        (lambda: build(Term, {"objective": "fame"}), "objective is 'fame', expected one of log_condition"),
        (lambda: build(Term, {"objective": "d_optimal", "together": 0}), "together is 0"),
        (lambda: build(Term, {"objective": "d_optimal", "noise": [1.0, 0.0]}), r"noise\[1\] is 0"),
        (lambda: Selection(5, "greedy", [3.0, 0.5]), "greedy score knows no noise"),
    ],
)
def test_settings_that_cannot_be_are_refused(make, words):
    with pytest.raises(ConfigError, match=words):
        make()


def test_sets_that_cannot_be_are_refused(planar_problem, random):
    with pytest.raises(ShapeError, match="expected 2 positive deviations"):
        SetInformation(planar_problem, 1, (1.0,))
    with pytest.raises(ShapeError, match="batch of 5 trajectories does not fall into sets of 2"):
        spectrum(SetInformation(planar_problem, 2), planar_problem.start(5, random))
