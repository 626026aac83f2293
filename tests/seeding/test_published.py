"""Seed sets of others, in the layout of the paper's authors, and their own 1800 where these are at hand."""

import numpy as np
import pytest

from sidegan.errors import ConfigError
from sidegan.motion.trajectory import Trajectory
from sidegan.seeding.optimise import SeedBatch, ship, shipped
from sidegan.seeding.published import SCALE, Layout, PublishedSeeds
from sidegan.validity import check
from tests.golden.make import DATA
from tests.refusals import refused

AUTHORS = DATA / "sidegan_authors"
PERIOD = 2 * np.pi / 0.4
SMALL = Trajectory(3, 2, PERIOD)  # 3 joints, 2 harmonics
MASTER = "train_trajectory_master_.npy"


def flat(count=4, seed=0):
    """Coefficients [rad/s] of each channel, joint after joint, (count, 2, 6)."""
    return np.random.default_rng(seed).uniform(-0.2, 0.2, (count, 2, 6))


def images(coefficients):
    """As they were published: reshaped to (harmonics, joints) all the same, and the first row repeated."""
    rows = SCALE * coefficients.reshape(len(coefficients), 2, 2, 3)
    return np.concatenate([rows, rows[:, :, :1]], 2)


def test_seeds_are_read_joint_by_joint_from_a_subfolder(tmp_path):
    (tmp_path / "below").mkdir()
    np.save(tmp_path / "below" / MASTER, images(flat()))
    c = PublishedSeeds(tmp_path).read(SMALL)
    assert c.shape == (4, 3, 2, 2) and c.dtype == np.float64
    joint, harmonic = 1, 0
    np.testing.assert_allclose(c[:, joint, harmonic], flat()[:, :, 2 * joint + harmonic], atol=1e-15)


def test_images_and_coefficients_are_inverse():
    layout, c = Layout(3, 2), flat().reshape(4, 3, 2, 2)
    np.testing.assert_allclose(layout.coefficients(layout.image(c)), c, rtol=1e-6)  # single precision
    np.testing.assert_allclose(layout.image(c), images(c.transpose(0, 3, 1, 2).reshape(4, 2, -1)), atol=1e-7)


@pytest.mark.parametrize(
    ("content", "about"),
    [
        (None, "git clone"),
        (np.zeros((1, 2, 7, 7)), "(2, 3, 3)"),
        (np.arange(18.0).reshape(1, 2, 3, 3), "last row"),
        (np.full((1, 2, 3, 3), np.nan), "last row"),
        (b"no array", MASTER),
        (np.full((1, 2, 3, 3), "a"), MASTER),
    ],
)
def test_a_wrong_layout_is_refused(tmp_path, content, about):
    if isinstance(content, bytes):
        (tmp_path / MASTER).write_bytes(content)
    elif content is not None:
        np.save(tmp_path / MASTER, content)
    with refused(ConfigError, str(tmp_path), about):
        PublishedSeeds(tmp_path).read(SMALL)


@pytest.mark.skipif(not AUTHORS.exists(), reason="the authors' seeds are not at hand")
def test_the_papers_seeds_are_valid_for_the_papers_arm(lwr_problem):
    c = PublishedSeeds(AUTHORS).read(Trajectory(7, 6, PERIOD))
    assert c.shape == (1800, 7, 6, 2) and np.abs(c).max() == pytest.approx(0.2, abs=1e-6)
    few, papers = c[::10], lwr_problem.constraints
    papers = type(papers)(papers.arm, papers.regions, torque=False)
    assert check(papers, Trajectory(7, 6, PERIOD), few).valid.mean() > 0.99
    mixed = few.swapaxes(1, 2).reshape(few.shape)  # read as if rows were harmonics
    assert check(papers, Trajectory(7, 6, PERIOD), mixed).valid.mean() < 0.05


def test_a_shipped_seed_file_serves_the_settings_that_made_it(tmp_path):
    batch = SeedBatch(flat().reshape(4, 3, 2, 2), np.arange(4.0), 5, 1, {"torque": 1}, 8.0)
    path, stamp = tmp_path / "seeds.npz", {"settings": {"box": 0.2}}
    assert shipped(path, stamp, 2) is None
    ship(path, stamp, batch)
    two = shipped(path, stamp, 2)
    assert np.array_equal(two.coefficients, batch.coefficients[:2].astype(np.float32).astype(float))
    assert two.cpu_seconds == 4 and two.faults == {"torque": 1} and two.fitness.tolist() == [0.0, 1.0]
    assert shipped(path, {"settings": {"box": 0.3}}, 2) is None and shipped(path, stamp, 5) is None
