from tests.robot.conftest import load  # noqa: F401
