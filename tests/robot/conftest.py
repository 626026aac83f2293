import pytest

from sidegan.robot import Setup, load_robot


@pytest.fixture
def load(tmp_path):
    """An arm from a description's text."""

    def load_text(text, setup=None, home=None, name="robot.urdf"):
        (tmp_path / name).write_text(text, encoding="utf-8")
        return load_robot(tmp_path / name, setup or Setup(), home)

    return load_text
