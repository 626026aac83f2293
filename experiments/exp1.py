"""Experiment 1 (Table I): one long trajectory / 35 seeds / 35 of seeds and generated ones, of equal length.

Source: Jegorova et al. 2020, section V-C.
"""

from dataclasses import dataclass
from pathlib import Path

import pandas as pd

from experiments import artifacts
from sidegan.base.storage import write_parquet
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report import figures, tables
from sidegan.report.export import publish, show, write_table

SIMULATOR, WEIGHTED = "Simulator", "Simulator, weighted RLS"
PLANT, PLANT_WEIGHTED = "MuJoCo plant", "MuJoCo plant, weighted"
PAPER_ROWS = {
    "Paper, simulator": {"long": "0.2248 ± 0.056", "seeds": "0.0063 ± 0.002", "generated": "0.0028 ± 0.001"},
    "Paper, real robot": {"long": "8.509 ± 9.906", "seeds": "0.0239 ± 0.017", "generated": "0.0210 ± 0.016"},
}
RAW, RAW_PLANT = "exp1.parquet", "plant.parquet"


_KEYS = ["seed", "set", "training", "repeat", "weighted", "joint"]


@dataclass(frozen=True)
class Material:
    """What the table is made from.

    Attributes:
        raw: nMSE and facts by set, training, repeat, weighted, joint.
        plant: the same nMSE from what was executed on the MuJoCo plant.
        histories: metrics after every epoch, by variant, one list for each training.
        generators: validity, fitness and diversity of the seeds and of every generator, a row each.
        config: the run's configuration.
    """

    raw: pd.DataFrame
    plant: pd.DataFrame
    histories: dict[str, list[list[dict[str, float | None]]]]
    generators: pd.DataFrame
    config: Config


def collect(task: Task) -> Material:
    """Everything that the table needs, from the artifacts."""
    return Material(
        artifacts.errors(task),
        artifacts.plant(task),
        artifacts.histories(task),
        artifacts.generators(task),
        task.cfg,
    )


def present(material: Material, folder: Path, tracker: Tracker) -> None:
    """Print, write and record Table I, what stands behind it, and its figures."""
    config, raw = material.config, material.raw
    write_parquet(folder / RAW, tables.arrow(raw))
    write_parquet(folder / RAW_PLANT, tables.arrow(material.plant))
    trainings = len(config.trainings)
    over = f"mean ± standard deviation over {config.identification.repeats} noise draws"
    over += f" and {trainings} trainings" if trainings > 1 else ""
    caption = f"Table I: nMSE of torque prediction, mean over joints ({over}, seed {config.seed})"
    made = {
        "table1": (table1(raw, material.plant, ["training", "repeat"]), caption),
        "joints": (tables.joints(raw), "nMSE by joint, unweighted RLS"),
        "sets": (tables.excitation_sets(raw), "The excitation sets"),
        "generators": (tables.generators(material.generators), "Seeds and generators, true physics"),
    }
    for name, (table, words) in made.items():
        publish(table, folder / name, words, tracker)
    seeds = {str(k): v for k, v in material.generators.set_index("name").loc["seeds"].items()}
    for name, figure in {
        "training": figures.training(material.histories, seeds),
        "nmse": figures.errors(raw),
    }.items():
        for path in figures.save(figure, folder / name):
            tracker.log_artifact(path, "figures")


def table1(raw: pd.DataFrame, plant: pd.DataFrame, over: list[str]) -> pd.DataFrame:
    """Table I with the paper's rows beside ours; the spread is taken over the columns ``over``."""
    rows = {}
    for label, frame, weighted in (
        (SIMULATOR, raw, False),
        (WEIGHTED, raw, True),
        (PLANT, plant, False),
        (PLANT_WEIGHTED, plant, True),
    ):
        part = frame[frame.weighted == weighted]
        means = part.groupby(["set", *over]).nmse.mean().groupby("set")
        rows[label] = {name: tables.spread(group) for name, group in means}
    columns = tables.ordered(raw["set"].unique())
    for label, paper in PAPER_ROWS.items():
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
