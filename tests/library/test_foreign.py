"""What a library from elsewhere says about itself is looked at before it is believed."""

from dataclasses import replace

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


def test_an_honest_one_is_read_as_it_is(honest, planar, tmp_path):
    """Also one without a valid trajectory, which has nothing to check."""
    for library in (honest, honest.take((~honest.valid).nonzero()[:, 0])):
        library.save(tmp_path / "library.parquet")
        found = load_foreign(tmp_path / "library.parquet", planar).coefficients
        torch.testing.assert_close(found, library.coefficients, rtol=0, atol=0)


LIES = {
    "calls itself valid violates": lambda x: replace(x, coefficients=1000.0 * x.coefficients),
    "are not those of its": lambda x: replace(x, coefficients=0.5 * x.coefficients),
    "calls itself valid with a negative margin": lambda x: replace(x, valid=torch.ones(40).bool()),
    "no trajectories": lambda x: x.take([]),
}


@pytest.mark.parametrize("words", LIES)
def test_lies_are_found(honest, planar, tmp_path, words):
    LIES[words](honest).save(tmp_path / "library.parquet")
    with pytest.raises(ArtifactError, match=words):
        load_foreign(tmp_path / "library.parquet", planar)
