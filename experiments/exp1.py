"""Experiment 1 (Table I): one long trajectory / 35 seeds / 35 of seeds and generated ones, of equal length.

Source: Jegorova et al. 2020, section V-C.
"""

from pathlib import Path

import pandas as pd

from experiments import training
from experiments.artifacts import Artifacts
from experiments.pages import leave
from experiments.words import PAPER
from sidegan.base.storage import write_parquet
from sidegan.pipeline.tracking import Tracker
from sidegan.report import figures, tables
from sidegan.report.export import show, write_table

SIMULATOR, WEIGHTED = "Simulator", "Simulator, weighted RLS"
EXPECTED, EXPECTED_WEIGHTED = "Simulator, expected", "Simulator, weighted, expected"
PLANT, PLANT_WEIGHTED = "MuJoCo plants", "MuJoCo plants, weighted"
RAW, RAW_PLANT = "exp1.parquet", "plant.parquet"
_KEYS = ["seed", "set", "training", "repeat", "weighted", "joint"]


collect = Artifacts


def present(artifacts: Artifacts, folder: Path, tracker: Tracker) -> None:
    """Print, write and record Table I, what stands behind it, and its figures."""
    config, raw = artifacts.cfg, artifacts.errors
    write_parquet(folder / RAW, tables.arrow(raw))
    write_parquet(folder / RAW_PLANT, tables.arrow(artifacts.plant))
    trainings = len(config.trainings)
    over = f"mean ± standard deviation over {config.identification.repeats} noise draws"
    over += f" and {trainings} trainings" if trainings > 1 else ""
    caption = f"Table I: nMSE of torque prediction, mean over joints ({over}, seed {config.seed})"
    shown = {
        "table1": (table1(raw, artifacts.plant, ["training", "repeat"], artifacts.expected), caption),
        "joints": (tables.joints(raw), "nMSE by joint, unweighted RLS"),
        "sets": (tables.excitation_sets(raw), "The excitation sets"),
        "generators": (tables.generators(artifacts.generators), "Seeds and generators, true physics"),
    }
    progress = training.figure(artifacts.histories, artifacts.few_seeds)
    leave(folder, tracker, shown, {"training": progress, "nmse": figures.errors(raw)})


def table1(
    raw: pd.DataFrame, plant: pd.DataFrame, over: list[str], expected: pd.DataFrame | None = None
) -> pd.DataFrame:
    """Table I with the paper's rows beside ours; the spread is taken over the columns ``over``.

    Errors that are expected over all noise draws stand below those of some, where they are given.
    """
    rows, parts = {}, {SIMULATOR: raw[~raw.weighted], WEIGHTED: raw[raw.weighted]}
    if expected is not None and len(expected):
        known = expected.weighted.astype(bool)
        parts |= {EXPECTED: expected[~known], EXPECTED_WEIGHTED: expected[known]}
    parts |= {PLANT: plant[~plant.weighted], PLANT_WEIGHTED: plant[plant.weighted]}
    for label, part in parts.items():
        levels = [key for key in over if key in part]
        means = part.groupby(["set", *levels]).nmse.mean().groupby("set")
        rows[label] = {name: tables.spread(group) for name, group in means}
    columns = tables.ordered(raw["set"].unique())
    for label, paper in PAPER["table1"].items():
        rows[label] = {name: paper.get(_kind(name), "—") for name in columns}
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns).fillna("—")
    table.columns = [tables.title(name) for name in columns]
    return table.rename_axis("nMSE")


def _kind(name: str) -> str:
    """Which of the paper's columns a set belongs to."""
    if name.startswith("long"):
        return "long"
    return name if name in ("seeds", "random") else "generated"


def aggregate(folders: list[Path], sweep: Path) -> pd.DataFrame | None:
    """Table I over all jobs of a sweep: mean ± standard deviation over the seeds of the whole experiment."""
    whole = [folder for folder in folders if (folder / RAW).exists() and (folder / RAW_PLANT).exists()]
    if not whole:
        return None
    raw, plant = (
        pd.concat([pd.read_parquet(folder / name) for folder in whole]).drop_duplicates(_KEYS)
        for name in (RAW, RAW_PLANT)
    )
    table = table1(raw, plant, ["seed"])
    caption = (
        f"Table I over {raw.seed.nunique()} seeds of the whole experiment: nMSE, mean ± standard deviation"
    )
    write_table(table, sweep / "table1", caption)
    show(table, caption)
    return table
