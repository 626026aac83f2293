"""Sets of trajectories in tables and figures: their order, labels and colours."""

import re
import zlib
from collections.abc import Collection, Iterable
from itertools import cycle

from sidegan.report.style import PALETTE

# Kinds of sets whose names end with a number: of harmonics, evaluations, or measurements.
_NUMBERED = re.compile(r"(long-|search-|boxed-|seeds ×)(\d+)")
_PAPERS_ORDER = (
    *("long-", "random", "natural", "search-", "boxed-", "gradient"),
    *("seeds", "seeds ×", "vanilla", "eigen", "diagonal", "prediction"),
)
SEEDS_ORIGIN = {  # by the method of their settings
    "published": "of the authors",
    "paper": "by the paper's optimisers",
    "gradient": "by gradient descent, the better optimiser",
}
_TITLES = {"random": "random valid", "gradient": "short, by gradients"}
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


def kind_of(name: str) -> tuple[str, int]:
    """A set's kind and the number at its end; of a name without one, the whole name and 0."""
    found = _NUMBERED.fullmatch(name)
    return (found[1], int(found[2])) if found else (name, 0)


def sort_sets(sets: Iterable[str]) -> list[str]:
    """Names of sets in the order of the paper's table: long trajectories first, unknown sets last."""

    def place(name: str) -> tuple[int, int, str]:
        kind, number = kind_of(name)
        return _PAPERS_ORDER.index(kind) if kind in _PAPERS_ORDER else len(_PAPERS_ORDER), number, name

    return sorted(sets, key=place)


def title(name: str) -> str:
    """Label of a set."""
    kind, number = kind_of(name)
    if kind == "long-":
        return f"single long, {number} harmonics"
    if kind in ("seeds", "seeds ×"):
        return name
    return _TITLES.get(name, f"seeds + {name}")


def weighting(weighted: bool) -> str:
    """Label of a weighting of the least squares."""
    return "weighted per joint" if weighted else "unweighted, as in the paper"


def colour(name: str) -> str:
    """Colour of a set or variant, the same in every figure."""
    return _COLOURS.get(name, PALETTE[zlib.crc32(name.encode()) % len(PALETTE)])


def colours(names: Collection[str]) -> list[str]:
    """Colour of each set or variant; different ones for single long trajectories, by their harmonics."""
    longs = [name for name in sort_sets(names) if kind_of(name)[0] == "long-"]
    shades = dict(zip(longs, cycle(_LONG)))
    return [shades.get(name) or colour(name) for name in names]
