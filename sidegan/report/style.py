"""Colours and words that the figures and pages share."""

import math
from collections.abc import Iterable

from sidegan.base.names import plain
from sidegan.report.tables import ordered

NOT_MEASURED = "not measured"
# Told apart on white and on dark pages, and by people who see red and green alike.
_COLOURS = {
    "vanilla": "#7f7f7f",
    "eigen": "#1f77b4",
    "diagonal": "#d95f02",
    "exact": "#1b9e77",
    "seeds": "#7b4fb5",
    "union": "#d4a200",
    "random": "#4d9221",
    "long-6": "#b2182b",
}
_LONG = "#ef8a62"
PALETTE = ("#1f77b4", "#d95f02", "#1b9e77", "#a6559d", "#b08a00", "#b2182b", "#7f7f7f", "#4d9221")
DESK = "#b59b7c"  # in pictures of motion


def colours(names: Iterable[str]) -> dict[str, str]:
    """Colours of groups, in the order to draw them: sets as everywhere else, others from a palette."""
    names = list(dict.fromkeys(names))
    if all(name in _COLOURS or name.startswith("long-") for name in names):
        return {name: colour(name) for name in ordered(names)}
    return {name: PALETTE[i % len(PALETTE)] for i, name in enumerate(names)}


def colour(name: str) -> str:
    """Colour of a set, the same in every figure."""
    return _COLOURS.get(name, _LONG if name.startswith("long-") else _COLOURS["random"])


def number(value: float, form: str) -> str:
    """A number for people."""
    return NOT_MEASURED if math.isnan(value) else plain(value, form)


def seconds(duration: float) -> str:
    """A duration in the unit that people would say: ``1.4 ms``, ``6 min``, ``14 h``."""
    units = (("h", 3600.0), ("min", 60.0), ("s", 1.0), ("ms", 1e-3))
    unit, size = next(((unit, size) for unit, size in units if duration >= size), ("µs", 1e-6))
    return NOT_MEASURED if math.isnan(duration) else f"{plain(duration / size)} {unit}"
