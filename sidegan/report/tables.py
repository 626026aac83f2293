"""Numbers as the text of tables."""

import math
from collections.abc import Mapping, Sequence

import pandas as pd

from sidegan.base.names import plain


def spread(values: pd.Series) -> str:
    """Mean ± standard deviation with two significant digits, and the mean rounded to match.

    Missing values are ignored; a single value has no deviation, and none gives a dash.
    """
    known = values.dropna().astype(float)
    mean, deviation = float(known.mean()), float(known.std())
    if len(known) < 2:
        return plain(mean) if len(known) else "—"
    if (
        mean
        and 0 < deviation < math.inf
        and (place := _decimal_exponent(deviation) - 1) > _decimal_exponent(mean) - 2
    ):
        mean = round(mean, -place)
    return f"{plain(mean)} ± {plain(deviation, '.2g')}"


def _decimal_exponent(value: float) -> int:
    """The exponent of a number's first digit."""
    return math.floor(math.log10(abs(value)))


def formatted(frame: pd.DataFrame, columns: Mapping[str, Sequence[str]], unknown: str = "—") -> pd.DataFrame:
    """Columns of numbers as text, by label and format, with a word for missing values."""
    rows = frame.reindex(columns=list(columns))
    cells = {
        name: [unknown if pd.isna(x) else plain(x, form) for x in rows[key]]
        for key, (name, form) in columns.items()
    }
    return pd.DataFrame(cells, frame.index)
