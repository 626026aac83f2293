import pytest

from sidegan.motion.dynamics import RigidBody


@pytest.fixture(autouse=True)
def messages(of_the_command):
    """Messages are those of the command."""


@pytest.fixture(scope="session")
def body(planar):
    """Dynamics of the planar arm."""
    return RigidBody(planar)
