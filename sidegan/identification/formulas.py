"""Base parameters as people read them."""

from collections.abc import Sequence

from torch import Tensor

_DIGITS = 4


def formula(shares: Tensor, names: Sequence[str]) -> str:
    """A grouping as text, such as "m6 + 0.078 m7", from each parameter's share (F,) and name."""
    parts = [(float(share), name) for share, name in zip(shares.tolist(), names) if share != 0.0]
    text = " ".join(_part(share, name) for share, name in sorted(parts, key=lambda part: part[0] != 1.0))
    return text.removeprefix("+ ")


def _part(share: float, name: str) -> str:
    sign = "-" if share < 0 else "+"
    size = f"{abs(share):.{_DIGITS}g}"
    return f"{sign} {name}" if size == "1" else f"{sign} {size} {name}"
