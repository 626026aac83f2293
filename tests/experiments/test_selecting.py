import numpy as np
import pytest
import torch

from experiments import selecting
from sidegan.design.excitation import excite
from sidegan.design.greedy import greedy
from sidegan.errors import ShapeError
from sidegan.identification import Noise, StudySettings
from sidegan.motion.dynamics import RigidBody
from sidegan.motion.trajectory import Trajectory

SETTINGS = StudySettings(20.0, 1e6, 1.0, True, Noise("multiplicative", 0.1, True, False), 2, 3)


def family(count, seed):
    trajectory = Trajectory(2, 3, 8.0)
    generator = torch.Generator().manual_seed(seed)
    return trajectory, 0.3 * torch.randn(count, *trajectory.shape, generator=generator, dtype=torch.float64)


@pytest.fixture(scope="module")
def body(planar):
    return RigidBody(planar)


@pytest.fixture(scope="module")
def frame(body):
    pool = family(60, 0)
    diagonals = excite(body, *pool).diagonal
    random = np.random.SeedSequence(0)
    return selecting.compare(body, pool, diagonals, family(5, 1), SETTINGS, 6, random).set_index("method")


def test_every_method_has_its_row(frame):
    assert frame.index[0] == "greedy" and frame.index[-1] == "random"
    assert frame.notna().all(axis=None)
    assert (frame.drop(columns=["log_det", "log_det_most"]) >= 0).all(axis=None)
    assert (frame.condition >= 1).all() and (frame.nmse < 1).all()


def test_each_criterion_is_largest_where_it_was_optimised(frame):
    assert frame.log_det.idxmax() == "D"
    assert (frame.log_det <= frame.log_det_most + 1e-9).all()


def test_the_papers_pick_is_the_papers(body):
    pool = family(30, 0)
    diagonals = excite(body, *pool).diagonal
    picks = selecting.methods(*selecting.informations(body, pool), diagonals, np.random.SeedSequence(0))
    assert torch.equal(picks["greedy"](5), greedy(diagonals, 5))
    chosen = {name: pick(5).tolist() for name, pick in picks.items()}
    assert all(len(set(one)) == 5 for one in chosen.values())
    again = selecting.methods(*selecting.informations(body, pool), diagonals, np.random.SeedSequence(0))
    assert chosen == {name: pick(5).tolist() for name, pick in again.items()}


def test_sizes_of_torques_are_those_of_the_dynamics(body):
    trajectory, c = family(450, 0)
    sizes = selecting.torque_sizes(body, trajectory, c, 20)
    torque = body.torque(*trajectory.roll_out(c[440:441], trajectory.grid(20))[1:])
    torch.testing.assert_close(sizes[440], (torque[0] ** 2).mean(0).sqrt())
    assert sizes.shape == (450, 2)


def test_diagonals_of_other_trajectories_are_refused(body):
    with pytest.raises(ShapeError, match="2 diagonals"):
        selecting.compare(
            body, family(3, 0), torch.ones(2, 5), family(2, 1), SETTINGS, 2, np.random.SeedSequence(0)
        )


def test_a_count_that_cannot_be_is_refused(body):
    pool = family(3, 0)
    diagonals = excite(body, *pool).diagonal
    with pytest.raises(ShapeError, match="4 of 3"):
        selecting.compare(body, pool, diagonals, family(2, 1), SETTINGS, 4, np.random.SeedSequence(0))
