"""Colours and formats that figures and pages share."""

import zlib
from collections.abc import Collection
from itertools import cycle

from sidegan.report.tables import kind_of, sort_sets

# Distinct on white and dark pages, and for colour-blind readers.
_COLOURS = {
    "vanilla": "#7f7f7f",
    "eigen": "#1f77b4",
    "diagonal": "#d95f02",
    "prediction": "#e7298a",
    "exact": "#1b9e77",
    "seeds": "#7b4fb5",
    "union": "#d4a200",
    "random": "#4d9221",
    "gradient": "#8c510a",
}
_LONG = ("#b2182b", "#ef8a62", "#67001f")  # long trajectories, one after another
PALETTE = ("#1f77b4", "#d95f02", "#1b9e77", "#a6559d", "#b08a00", "#b2182b", "#7f7f7f", "#4d9221")
DESK = "#b59b7c"  # in pictures of motion


def colour(name: str) -> str:
    """Colour of a set or variant, the same in every figure."""
    return _COLOURS.get(name, PALETTE[zlib.crc32(name.encode()) % len(PALETTE)])


def colours(names: Collection[str]) -> list[str]:
    """Colour of each set or variant; different ones for single long trajectories, by their harmonics."""
    longs = [name for name in sort_sets(names) if kind_of(name)[0] == "long-"]
    shades = dict(zip(longs, cycle(_LONG)))
    return [shades.get(name) or colour(name) for name in names]
