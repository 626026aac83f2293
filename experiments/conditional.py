"""Conditioned generation: how well each kind of condition is met, at what cost; or a library for one."""

from pathlib import Path
from typing import Any

import pandas as pd

from experiments.artifacts import LIBRARY, STUDY, Conditional, Report, conditional
from experiments.pages import leave
from sidegan.base.storage import write_bytes, write_json
from sidegan.pipeline.tracking import Tracker

MET, LOSS = 0.97, 1.5  # goals: share of samples that meet their condition, loss against a dedicated generator
_KINDS = {
    "met": "success",
    "met, worst": "worst_success",
    f"≥ {MET:.0%}": "enough",
    "unsettled": "raw_success",
    "mean distance": "distance",
    "median cond(YᵀY)": "condition",
    "… compared": "compared",
    "dedicated": "dedicated",
    "ratio": "ratio",
    f"≤ {LOSS:g}": "cheap",
}
_LINKS = {"parameters": "parameters", "mean": "variance", "worst": "worst", "other links": "others"}
_LIBRARY = {
    "trajectories": "count",
    "drawn": "drawn",
    "met": "valid_share",
    "median cond(YᵀY)": "condition",
    "mean distance": "distance",
    "effective rank": "rank",
}
_SHARES = ("success", "worst_success", "raw_success", "valid_share")

collect = conditional


def present(result: Conditional, folder: Path, tracker: Tracker) -> None:
    """Print, write and record the tables, or the library."""
    shown = {}
    if result.study is not None:
        write_json(folder / STUDY, result.study)
        shown["conditions"] = kinds(result.study["kinds"]), "Conditions, by the true check"
        if result.study["links"]:
            caption = "Variance of the chosen links' parameters, best sets, conditioned over unconditional"
            shown["links"] = _table(result.study["links"], "links", _LINKS), caption
    if result.library is not None:
        write_bytes(folder / LIBRARY, result.library.read_bytes())
        facts = {name: _word(key, result.report[key]) for name, key in _LIBRARY.items()}
        table = pd.DataFrame({"value": pd.Series(facts)}).rename_axis("fact")
        shown["library"] = table, "Trajectories for what is asked"
    leave(folder, tracker, shown)


def kinds(rows: list[Report]) -> pd.DataFrame:
    """A row per kind of condition, with the verdict on both goals."""
    judged = [
        row | {"enough": row["success"] >= MET, "cheap": row["ratio"] <= LOSS if row.get("ratio") else None}
        for row in rows
    ]
    return _table(judged, "kind", _KINDS).rename_axis("condition")


def _table(rows: list[Report], index: str, columns: dict[str, str]) -> pd.DataFrame:
    cells = {row[index]: {name: _word(key, row.get(key)) for name, key in columns.items()} for row in rows}
    return pd.DataFrame.from_dict(cells, orient="index").rename_axis(index)


def _word(key: str, value: Any) -> Any:
    """A share, verdict or number for people; a dash where nothing is known."""
    if value is None:
        return "—"
    if isinstance(value, bool):
        return "yes" if value else "no"
    if key in _SHARES:
        return f"{value:.1%}"
    return value if isinstance(value, int) else f"{value:.3g}" if value < 1000 else f"{value:.0f}"
