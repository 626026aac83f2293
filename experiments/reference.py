"""Reference data: the paper's numbers and claims, and the columns of tables."""

from pathlib import Path
from typing import Any

import yaml


def _read(name: str) -> dict[str, Any]:
    return yaml.safe_load(Path(__file__).with_name(name).read_text(encoding="utf-8"))


PAPER, COLUMNS = _read("paper.yaml"), _read("columns.yaml")
