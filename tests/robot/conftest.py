from collections.abc import Callable
from pathlib import Path

import pytest

from sidegan.robot import Arm, load_robot


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., Arm]:
    """An arm from a URDF's text."""

    def load_text(text: str, name: str = "robot.urdf") -> Arm:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return load_robot(path)

    return load_text
