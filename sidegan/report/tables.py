"""Formatted tables from the results of runs."""

import math
import re
from collections.abc import Iterable, Mapping, Sequence

import pandas as pd

from sidegan.base.names import plain

# Kinds of sets whose names end with a number: of harmonics, evaluations, or measurements.
_NUMBERED = re.compile(r"(long-|search-|boxed-|seeds ×)(\d+)")
_PAPERS_ORDER = (
    *("long-", "random", "natural", "search-", "boxed-", "gradient"),
    *("seeds", "seeds ×", "vanilla", "eigen", "diagonal", "prediction"),
)
_TITLES = {"random": "random valid", "gradient": "short, by gradients"}
_SETS = {
    "duration": ("duration [s]", "g"),
    "samples": ("samples", ".0f"),
    "condition": ("cond(YᵀY) of the stack", ".4g"),
    "covariance_norm": ("‖diag P‖", ".4g"),
}
# Labels of the columns of the table of generators …
WORTH = {
    "condition": "median cond(YᵀY)",
    "condition_valid": "… of the valid",
    "gain": "gain, the paper's noise",
    "gain_geometric": "… geometric",
    "gain_constant": "gain, constant noise",
    "gain_constant_geometric": "… geometric, constant",
    "distance": "mean distance",
    "norm": "mean norm",
    "cosine": "mean cosine",
    "rank_uncentred": "effective rank, uncentred",
}
# … and of the table of their similarity to the seeds.
LIKENESS = {
    "nearest_other": "nearest distance",
    "nearest_seed": "to the nearest seed",
    "beyond": "share beyond the seeds' ranges",
    "density": "density of c",
    "coverage": "coverage of c",
    "density_diagonal": "density of log diag(YᵀY)",
    "coverage_diagonal": "coverage of log diag(YᵀY)",
    "told_apart": "accuracy of a classifier against the seeds",
    "distance_diagonal": "mean distance of diag(YᵀY)",
}


def kind_of(name: str) -> tuple[str, int]:
    """The kind of a set and the number that its name ends with; of others their whole name, and 0."""
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


def weighting(weighted: bool) -> str:
    """Label of a weighting of the least squares."""
    return "weighted per joint" if weighted else "unweighted, as in the paper"


def formatted(frame: pd.DataFrame, columns: Mapping[str, Sequence[str]], unknown: str = "—") -> pd.DataFrame:
    """Columns of numbers as text, by label and format, with a word for missing values."""
    rows = frame.reindex(columns=list(columns))
    cells = {
        name: [unknown if pd.isna(x) else plain(x, form) for x in rows[key]]
        for key, (name, form) in columns.items()
    }
    return pd.DataFrame(cells, frame.index)


def joint_table(raw: pd.DataFrame) -> pd.DataFrame:
    """Mean nMSE by joint and set, unweighted."""
    part = raw[~raw.weighted]
    table = part.groupby(["joint", "set"], sort=False).nmse.mean().unstack("set")
    table = table[sort_sets(table.columns)].map(plain)
    return table.rename(columns=title)


def excitation_table(raw: pd.DataFrame) -> pd.DataFrame:
    """Duration, condition number and covariance norm of every excitation set."""
    once = raw.drop_duplicates(["set", "training", "repeat"])
    mean = once.groupby("set")[list(_SETS)].mean()
    return formatted(mean.loc[sort_sets(mean.index)], _SETS).rename(index=title)


def generator_table(frame: pd.DataFrame) -> pd.DataFrame:
    """Worth of the seeds, baselines and generators, over trainings."""
    rows = frame.assign(
        valid_share=valid_share(frame),
        condition_valid=frame.condition_valid.fillna(frame.condition),
    )
    return _spreads(rows, {"valid_share": "valid share", **WORTH})


def valid_share(frame: pd.DataFrame) -> pd.Series:
    """Valid share of all that was drawn for a generator's library, and of the other sets."""
    return frame.valid_share.fillna(frame.valid)


def likeness_table(frame: pd.DataFrame) -> pd.DataFrame:
    """Similarity to the seeds of baselines, generators over trainings, and the seeds themselves."""
    return _spreads(frame, LIKENESS)


def _spreads(frame: pd.DataFrame, columns: Mapping[str, str]) -> pd.DataFrame:
    """Columns with their labels, a row for each generator."""
    known = {key: label for key, label in columns.items() if key in frame}
    table = frame.groupby("name")[list(known)].agg(spread).rename(columns=known)
    return table.loc[sort_sets(table.index)].rename_axis("generator")
