"""Figure 3: success, fitness and diversity of every variant against epoch, with the true physics.

Source: Jegorova et al. 2020, section V-B.
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
from sidegan.report.export import publish

RAW = "training.parquet"
_GOOD = 0.8  # share of valid samples that counts as reliable


@dataclass(frozen=True)
class Material:
    """What the figure is made from.

    Attributes:
        histories: metrics after every epoch, by variant, one list for each training.
        generators: validity, fitness and diversity of the seeds and of every generator, a row each.
        config: the run's configuration.
    """

    histories: dict[str, list[list[dict[str, float | None]]]]
    generators: pd.DataFrame
    config: Config


def collect(task: Task) -> Material:
    """Everything that the figure needs, from the artifacts."""
    return Material(artifacts.histories(task), artifacts.generators(task), task.cfg)


def present(material: Material, folder: Path, tracker: Tracker) -> None:
    """Draw, write and record the figure and the tables behind it."""
    write_parquet(folder / RAW, tables.arrow(long_form(material.histories)))
    trainings = len(material.config.trainings)
    over = f"{trainings} trainings, {material.config.scale.evaluation} samples per epoch"
    caption = f"Seeds and generators after the last epoch, true physics ({over})"
    publish(tables.generators(material.generators), folder / "generators", caption, tracker)
    publish(speed(material.histories), folder / "epochs", f"Epochs to a valid share of {_GOOD:.0%}", tracker)
    seeds = {str(k): v for k, v in material.generators.set_index("name").loc["seeds"].items()}
    for path in figures.save(figures.training(material.histories, seeds), folder / "training"):
        tracker.log_artifact(path, "figures")


def long_form(histories: dict[str, list[list[dict[str, float | None]]]]) -> pd.DataFrame:
    """A row per variant, training and epoch."""
    rows = [
        {"variant": name, "training": training, "epoch": epoch + 1, **row}
        for name, runs in histories.items()
        for training, history in enumerate(runs)
        for epoch, row in enumerate(history)
    ]
    return pd.DataFrame(rows)


def speed(histories: dict[str, list[list[dict[str, float | None]]]]) -> pd.DataFrame:
    """First epoch after which a generator is reliable, and its best and last valid share."""
    rows = {}
    for name, runs in histories.items():
        share = [[row["success"] or 0.0 for row in history] for history in runs]
        first = [next((i + 1 for i, x in enumerate(one) if x >= _GOOD), None) for one in share]
        rows[name] = {
            "first epoch": ", ".join("never" if x is None else str(x) for x in first),
            "valid after 10 epochs": tables.spread(pd.Series([one[min(9, len(one) - 1)] for one in share])),
            "best": tables.spread(pd.Series([max(one) for one in share])),
            "last": tables.spread(pd.Series([one[-1] for one in share])),
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("variant")
