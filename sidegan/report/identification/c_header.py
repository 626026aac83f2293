"""The identified arm as a C header: inverse dynamics for a controller's loop."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from sidegan.report.document import rendered
from sidegan.robot import Arm


def c_header(arm: Arm, numbers: Mapping[str, Any], recordings: Sequence[str], verdict: str) -> bytes:
    """The recommended model as a C99 header, from ``arm.h.jinja``; ``recordings`` are their names.

    Chain and gravity are the arm's; of numbers, as in parameters.json, ``use``, ``sign_width`` and
    ``usual_load`` count.
    """
    words = {"recordings": recordings, "verdict": verdict, **numbers}
    return rendered(Path(__file__).parent / "arm.h.jinja", {"braces": _braces}, arm=arm, **words)


def _braces(values: ArrayLike) -> str:
    """An array as a C initializer, a line per row of a matrix; its numbers read back exactly."""
    x = np.asarray(values)
    text = (", " if x.ndim == 1 else ",\n    ").join(map(str, x.tolist()))
    return "{" + text.translate(str.maketrans("[]", "{}")) + "}"
