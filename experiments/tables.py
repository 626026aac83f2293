"""Tables of the paper's experiments, from frames of results."""

from collections.abc import Mapping

import pandas as pd

from experiments.sets import sort_sets, title
from sidegan.base.names import plain
from sidegan.report.tables import formatted, spread

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
    """Share of valid trajectories: of all that were drawn for a set, or else of the set itself."""
    return frame.valid_share.fillna(frame.valid)


def likeness_table(frame: pd.DataFrame) -> pd.DataFrame:
    """Similarity to the seeds of baselines, generators over trainings, and the seeds themselves."""
    return _spreads(frame, LIKENESS)


def _spreads(frame: pd.DataFrame, columns: Mapping[str, str]) -> pd.DataFrame:
    """Mean ± deviation of labelled columns over trainings, a row for each set."""
    known = {key: label for key, label in columns.items() if key in frame}
    table = frame.groupby("name")[list(known)].agg(spread).rename(columns=known)
    return table.loc[sort_sets(table.index)].rename_axis("generator")
