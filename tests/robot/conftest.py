from collections.abc import Callable, Sequence
from pathlib import Path

import pytest

from sidegan.robot import Arm, Setup, load_robot


@pytest.fixture
def load(tmp_path: Path) -> Callable[..., Arm]:
    """An arm from a description's text."""

    def load_text(
        text: str,
        setup: Setup | None = None,
        home: Sequence[float] | None = None,
        name: str = "robot.urdf",
    ) -> Arm:
        path = tmp_path / name
        path.write_text(text, encoding="utf-8")
        return load_robot(path, setup or Setup(), home)

    return load_text
