"""Time stamps as files hold them: numbers, also since 1970, dates with time zones, times of day."""

import warnings
from collections.abc import Callable, Sequence
from typing import Any

import numpy as np
import pandas as pd

from sidegan.base.arrays import Array
from sidegan.recording import thresholds
from sidegan.recording.tables import Table
from sidegan.recording.units import SECONDS, Units

_EPOCH = pd.Timestamp("1970-01-01", tz="UTC")
_OF_TEXT: tuple[Callable[[Any], Any], ...] = (
    lambda texts: pd.to_datetime(texts, utc=True, errors="coerce", format="ISO8601") - _EPOCH,
    lambda texts: pd.to_timedelta(texts, errors="coerce"),  # since midnight
    lambda texts: pd.to_timedelta("00:" + texts, errors="coerce"),  # minutes and seconds
    lambda texts: pd.to_datetime(texts, utc=True, errors="coerce") - _EPOCH,
)
_LONG = {"ms": "milliseconds", "us": "microseconds", "ns": "nanoseconds"}


def stamps_in_si(
    file: str, table: Table, columns: Sequence[str], units: Units
) -> tuple[Array, Sequence[str], list[str]]:
    """Time stamps [s], (S, 1), of a column, or of seconds and nanoseconds; the unit in its name; remarks.

    Dates become seconds since 1970. Without a configured unit, numbers are in ms, µs or ns if that makes
    them plausible times since 1970 at a plausible sampling rate.
    """
    if len(columns) > 1:
        seconds, nanoseconds = map(table.numbers, columns)
        return (seconds + 1e-9 * nanoseconds)[:, None], [], []
    dates = _dates(table.columns[columns[0]])
    if dates is not None:
        return dates[:, None], [], []
    stamps = table.numbers(columns[0])
    unit, factor = units.of(file, "time", False, table.heading(columns[0]))
    remarks = []
    if not (units.time or unit) and (since := _since_1970(stamps)):
        factor = SECONDS[since]
        remarks = [f"time stamps are {_LONG[since]} since 1970; recording.units.time overrides it"]
    return (stamps * factor).reshape(len(stamps), -1), [unit], remarks


def date_columns(table: Table) -> list[str]:
    """Columns whose first element is a date."""
    return [name for name, x in table.columns.items() if np.ndim(x) == 1 and _dates(x[:1]) is not None]


def _dates(values: Any) -> Array | None:
    """Dates as seconds since 1970, times of day as seconds since midnight, (S,); None if neither."""
    if np.ndim(values) != 1:
        return None
    series = pd.Series(values)
    found: Any = None
    if pd.api.types.is_datetime64_any_dtype(series):
        found = pd.to_datetime(series, utc=True) - _EPOCH
    elif pd.api.types.is_timedelta64_dtype(series):
        found = series
    elif (
        isinstance(next(iter(series.dropna()), None), str)
        and pd.to_numeric(series, errors="coerce").isna().mean() > thresholds.MOST_DATES
    ):
        texts = series.astype(str).str.replace(",", ".")
        with warnings.catch_warnings():
            warnings.simplefilter("ignore", UserWarning)  # that the format has to be guessed
            each = (read(texts) for read in _OF_TEXT)
            found = next((times for times in each if times.notna().mean() > thresholds.MOST_DATES), None)
    return None if found is None else found.dt.total_seconds().to_numpy(np.float64)


def _since_1970(stamps: Array) -> str:
    """The unit other than seconds in which stamps (S,) are times since 1970; empty if there is none."""
    steps = np.diff(stamps) if stamps.ndim == 1 else np.zeros(0)
    forward = steps[steps > 0]
    if not len(forward):
        return ""
    usual, step = float(np.nanmedian(stamps)), float(np.median(forward))
    earliest, latest = thresholds.SINCE_1970
    for unit in _LONG:
        factor = SECONDS[unit]
        if earliest < usual * factor < latest and step * factor < thresholds.LONGEST_STEP:
            return unit
    return ""
