from dataclasses import replace

import pytest

from sidegan.motion.dynamics import RigidBody
from tests.identification.recordings import model_of


@pytest.fixture(autouse=True)
def messages(of_the_command):
    """Messages are those of the command."""


@pytest.fixture(scope="session")
def body(planar):
    """Dynamics of the planar arm."""
    return RigidBody(planar)


@pytest.fixture(scope="session")
def model(arm):
    """A model of the seven joints with every term."""
    return model_of(arm)


@pytest.fixture(scope="session")
def heavier(planar):
    """The planar arm with more in its second link than its description says."""
    links = planar.inertial_parameters.copy()
    links[1, :2] += 1.0  # [kg, kg·m]
    return replace(planar, inertial_parameters=links)
