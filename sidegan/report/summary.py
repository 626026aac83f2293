"""What the figures draw: means and ranges of repeated results, plain arrays for any plotting library."""

from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from sidegan.errors import ConfigError, ShapeError
from sidegan.report.tables import ordered

History = Sequence[Mapping[str, float | None]]

_TICKS = (1e-6, 1e-3, 1.0, 60.0, 3600.0, 86400.0)  # [s]


class Line(NamedTuple):
    """Mean, lowest and highest value, (N,) each, at N places."""

    x: np.ndarray
    mean: np.ndarray
    low: np.ndarray
    high: np.ndarray


def epochs(runs: Sequence[History], key: str) -> Line:
    """A metric after every epoch, over the trainings that know it; as long as the longest of them."""
    length = max((len(history) for history in runs), default=0)
    values = np.full((len(runs), length), np.nan)
    for row, history in zip(values, runs):
        row[: len(history)] = [_value(epoch.get(key)) for epoch in history]
    known = pd.DataFrame(values)
    return Line(np.arange(1, length + 1), *(x.to_numpy() for x in (known.mean(), known.min(), known.max())))


def compared_with(
    key: str, seeds: Mapping[str, Any], union: Mapping[str, Any] | None
) -> list[tuple[str, str, float]]:
    """Set, name for people and value of a metric of the sets that trainings are compared with."""
    sets = (("seeds", "seeds", seeds), ("union", "seeds and generated", union or {}))
    found = [(name, words, known.get("valid" if key == "success" else key)) for name, words, known in sets]
    return [(name, words, value) for name, words, value in found if value is not None]


def weighting(weighted: bool) -> str:
    """What a weighting is called."""
    return "weighted per joint" if weighted else "unweighted, as in the paper"


def _value(x: float | None) -> float:
    return float("nan") if x is None else float(x)


def curves(frame: pd.DataFrame, x: str, y: str, group: str | None) -> dict[str, Line]:
    """Column ``y`` over column ``x`` of every group, over the rows that share both.

    Raises:
        ConfigError: when the frame lacks a column.
        ShapeError: when nothing is left to draw.
    """
    require(frame, [x, y, *([group] if group else [])])
    known = frame.dropna(subset=[x, y])
    if known.empty:
        raise ShapeError(f"there is nothing to draw: no row knows both {x} and {y}")
    parts = known.groupby(group, sort=False) if group else [("", known)]
    return {str(name): _line(part, x, y) for name, part in parts}


def _line(part: pd.DataFrame, x: str, y: str) -> Line:
    by_place = part.groupby(x, sort=not is_text(part[x]))[y].agg(["mean", "min", "max"])
    return Line(by_place.index.to_numpy(), *(by_place[k].to_numpy() for k in ("mean", "min", "max")))


def by_joint(raw: pd.DataFrame) -> dict[str, Line]:
    """NMSE over the joints of every set, in the order of the paper's table."""
    found = curves(raw, "joint", "nmse", "set")
    return {name: found[name] for name in ordered(found)}


def aligned(found: Mapping[str, Line]) -> dict[str, Line]:
    """Lines over text at the same places, NaN where a line knows none; lines over numbers as they are."""
    places = list(dict.fromkeys(x for line in found.values() for x in line.x))
    if not any(isinstance(x, str) for x in places):
        return dict(found)
    frames = {
        name: pd.DataFrame(line._asdict()).set_index("x").reindex(places) for name, line in found.items()
    }
    return {name: Line(np.array(places), *part.to_numpy().T) for name, part in frames.items()}


def is_text(values: pd.Series) -> bool:
    """Whether places have no distance between them."""
    return not pd.api.types.is_numeric_dtype(values)


def require(frame: pd.DataFrame, columns: Sequence[str]) -> None:
    """Refuse a frame that lacks a column.

    Raises:
        ConfigError: with the columns that are missing and those that are there.
    """
    missing = [name for name in columns if name not in frame.columns]
    if missing:
        raise ConfigError(
            f"the data has no column {', '.join(missing)}, only {', '.join(map(str, frame.columns))}"
        )


def durations(frame: pd.DataFrame) -> tuple[float, float]:
    """Ends [s] of an axis with room for all durations and what is written beside them.

    Raises:
        ConfigError: when the frame lacks a column.
        ShapeError: when no duration is known, or one is not positive.
    """
    require(frame, ["what", "ours", "paper"])
    values = frame[["ours", "paper"]].to_numpy(dtype=float)
    known = values[~np.isnan(values)]
    if len(known) == 0 or not (known > 0).all():
        raise ShapeError(f"durations must be positive and one at least known, got {known.tolist()}")
    return float(known.min()) / 3, float(known.max()) * 12


def time_ticks(low: float, high: float) -> list[float]:
    """Round durations [s] between two ends of an axis."""
    return [tick for tick in _TICKS if low <= tick <= high]
