"""The paper's own figures, beside its claims."""

from pathlib import Path
from typing import Any

import yaml

PAPER: dict[str, Any] = yaml.safe_load(Path(__file__).with_name("paper.yaml").read_text(encoding="utf-8"))
