"""Conditioned generation: how well each kind of condition is met, at what cost; or a library for one."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pandas as pd

from sidegan.base.storage import read_json, write_bytes, write_json
from sidegan.pipeline.plan import LIBRARY, REPORT, Task
from sidegan.pipeline.plan_conditional import STUDY, Conditions
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import publish

MET, LOSS = 0.97, 1.5  # goals: share of samples that meet their condition, loss against a dedicated generator


@dataclass(frozen=True)
class Material:
    """What the tables are made from.

    Attributes:
        study: a row per kind of condition, and one per choice of links; None where a library is asked for.
        asked: what is known of that library.
        library: its file.
    """

    study: dict[str, list[dict[str, Any]]] | None
    asked: dict[str, Any] | None = None
    library: Path | None = None


def collect(task: Task) -> Material:
    """Everything that the tables need, from the artifacts."""
    conditions = Conditions(task)
    if conditions.asked is None:
        return Material(read_json(task.store.require(conditions.study) / STUDY))
    folder = task.store.require(conditions.library)
    return Material(None, read_json(folder / REPORT), folder / LIBRARY)


def present(material: Material, folder: Path, tracker: Tracker) -> None:
    """Print, write and record the tables, or the library."""
    if material.study is not None:
        write_json(folder / STUDY, material.study)
        publish(
            kinds(material.study["kinds"]), folder / "conditions", "Conditions, by the true check", tracker
        )
        if material.study["links"]:
            caption = "Variance of the chosen links' parameters, best sets, conditioned over unconditional"
            publish(links(material.study["links"]), folder / "links", caption, tracker)
    if material.asked is not None and material.library is not None:
        write_bytes(folder / LIBRARY, material.library.read_bytes())
        publish(library(material.asked), folder / "library", "Trajectories for what is asked", tracker)


def kinds(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """A row per kind of condition."""
    table = {
        row["kind"]: {
            "met": _share(row["success"]),
            "met, worst": _share(row["worst_success"]),
            f"≥ {MET:.0%}": _verdict(row["success"] >= MET),
            "unsettled": _share(row["raw_success"]),
            "mean distance": _number(row["distance"]),
            "median cond(YᵀY)": _number(row["condition"]),
            "… compared": _number(row.get("compared")),
            "dedicated": _number(row.get("dedicated")),
            "ratio": _number(row.get("ratio")),
            f"≤ {LOSS:g}": _verdict(row["ratio"] <= LOSS) if row.get("ratio") else "—",
        }
        for row in rows
    }
    return pd.DataFrame.from_dict(table, orient="index").rename_axis("condition")


def links(rows: list[dict[str, Any]]) -> pd.DataFrame:
    """A row per choice of links."""
    names = {"variance": "mean", "worst": "worst", "others": "other links"}
    table = {
        row["links"]: {"parameters": row["parameters"]} | {names[k]: _number(row[k]) for k in names}
        for row in rows
    }
    return pd.DataFrame.from_dict(table, orient="index").rename_axis("links")


def library(asked: dict[str, Any]) -> pd.DataFrame:
    """What is known of a library, a row per fact."""
    told = {
        "trajectories": asked["count"],
        "drawn": asked["drawn"],
        "met": _share(asked["valid_share"]),
        "median cond(YᵀY)": _number(asked["condition"]),
        "mean distance": _number(asked["distance"]),
        "effective rank": _number(asked["rank"]),
    }
    return pd.DataFrame({"value": pd.Series(told)}).rename_axis("fact")


def _share(value: float) -> str:
    return f"{value:.1%}"


def _number(value: float | None) -> str:
    return "—" if value is None else f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def _verdict(good: bool) -> str:
    return "yes" if good else "no"
