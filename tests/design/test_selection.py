"""The configured pick is that of the function it names."""

import pytest
import torch

from sidegan.design.excitation import excite
from sidegan.design.greedy import greedy
from sidegan.design.information import information_of
from sidegan.design.optimal import a_optimal, d_optimal
from sidegan.design.selection import Selection, choose


@pytest.mark.parametrize("noise", [None, [3.0, 0.5]])
@pytest.mark.parametrize("pick", [d_optimal, a_optimal])
def test_each_method_is_its_function(planar_problem, random, pick, noise):
    of = planar_problem.body, planar_problem.trajectory, planar_problem.start(40, random)
    deviation = None if noise is None else torch.tensor(noise, dtype=torch.float64)
    chosen = choose(Selection(5, pick.__name__, noise), *of, torch.zeros(0, 0))
    assert chosen.tolist() == pick(information_of(*of, deviation=deviation), 5).tolist()


def test_the_papers_score_sees_the_diagonal_alone(planar_problem, random):
    of = planar_problem.body, planar_problem.trajectory, planar_problem.start(40, random)
    diagonal = excite(*of).diagonal
    assert choose(Selection(5, "greedy", None), *of, diagonal).tolist() == greedy(diagonal, 5).tolist()
