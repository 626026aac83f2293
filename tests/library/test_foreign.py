"""What a library from elsewhere says about itself is looked at before it is believed."""

import dataclasses

import pytest
import torch

from sidegan.errors import ArtifactError
from sidegan.library.foreign import load_foreign
from sidegan.library.measure import measured
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Constraints, Plane


@pytest.fixture(scope="module")
def honest(planar):
    """Valid and invalid trajectories, measured in a workspace that the reader does not know."""
    c = torch.randn(40, 2, 3, 2, generator=torch.Generator().manual_seed(0), dtype=torch.float64)
    desk = Plane((0.0, 0.0, 1.0), -3.0)
    library = measured(Constraints(planar, [desk]), Trajectory(2, 3, 8.0), 0.5 * c, "made")
    assert 8 < int(library.valid.sum()) < 40
    return library


def saved(library, folder):
    library.save(folder / "library.parquet")
    return folder / "library.parquet"


def test_an_honest_one_is_read_as_it_is(honest, planar, tmp_path):
    torch.testing.assert_close(
        load_foreign(saved(honest, tmp_path), planar).coefficients, honest.coefficients, rtol=0, atol=0
    )


@pytest.mark.parametrize(
    ("factor", "expected"), [(1000.0, "calls itself valid violates"), (0.5, "are not those of its")]
)
def test_other_coefficients_under_the_same_margins_are_found(honest, planar, tmp_path, factor, expected):
    forged = dataclasses.replace(honest, coefficients=factor * honest.coefficients)
    with pytest.raises(ArtifactError, match=expected):
        load_foreign(saved(forged, tmp_path), planar)


def test_a_lie_without_a_change_of_margins_is_found(honest, planar, tmp_path):
    forged = dataclasses.replace(honest, valid=torch.ones(40, dtype=torch.bool))
    with pytest.raises(ArtifactError, match="calls itself valid with a negative margin"):
        load_foreign(saved(forged, tmp_path), planar)


def test_one_without_a_valid_trajectory_has_nothing_to_check(honest, planar, tmp_path):
    none = honest.take((~honest.valid).nonzero()[:, 0])
    assert len(load_foreign(saved(none, tmp_path), planar)) == len(none)


def test_an_empty_library_from_elsewhere_is_refused(honest, planar, tmp_path):
    with pytest.raises(ArtifactError, match="no trajectories"):
        load_foreign(saved(honest.take([]), tmp_path), planar)
