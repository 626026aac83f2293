"""Conditioned generation: how well each kind of condition is met, at what cost; or a library for one."""

from pathlib import Path

import pandas as pd

from experiments.artifacts import LIBRARY, STUDY, Conditional, Report, conditional
from sidegan.base.storage import write_bytes, write_json
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import publish

MET, LOSS = 0.97, 1.5  # goals: share of samples that meet their condition, loss against a dedicated generator


collect = conditional


def present(result: Conditional, folder: Path, tracker: Tracker) -> None:
    """Print, write and record the tables, or the library."""
    if result.study is not None:
        write_json(folder / STUDY, result.study)
        table = kinds(result.study["kinds"])
        publish(table, folder / "conditions", "Conditions, by the true check", tracker)
        if result.study["links"]:
            caption = "Variance of the chosen links' parameters, best sets, conditioned over unconditional"
            publish(links(result.study["links"]), folder / "links", caption, tracker)
    if result.library is not None:
        write_bytes(folder / LIBRARY, result.library.read_bytes())
        publish(library(result.report), folder / "library", "Trajectories for what is asked", tracker)


def kinds(rows: list[Report]) -> pd.DataFrame:
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


def links(rows: list[Report]) -> pd.DataFrame:
    """A row per choice of links."""
    names = {"variance": "mean", "worst": "worst", "others": "other links"}
    table = {
        row["links"]: {"parameters": row["parameters"]} | {names[k]: _number(row[k]) for k in names}
        for row in rows
    }
    return pd.DataFrame.from_dict(table, orient="index").rename_axis("links")


def library(report: Report) -> pd.DataFrame:
    """What is known of a library, a row per fact."""
    facts = {
        "trajectories": report["count"],
        "drawn": report["drawn"],
        "met": _share(report["valid_share"]),
        "median cond(YᵀY)": _number(report["condition"]),
        "mean distance": _number(report["distance"]),
        "effective rank": _number(report["rank"]),
    }
    return pd.DataFrame({"value": pd.Series(facts)}).rename_axis("fact")


def _share(value: float) -> str:
    return f"{value:.1%}"


def _number(value: float | None) -> str:
    return "—" if value is None else f"{value:.3g}" if value < 1000 else f"{value:.0f}"


def _verdict(good: bool) -> str:
    return "yes" if good else "no"
