import pytest

from sidegan.motion.dynamics import RigidBody


@pytest.fixture(scope="session")
def body(planar):
    """Dynamics of the planar arm."""
    return RigidBody(planar)
