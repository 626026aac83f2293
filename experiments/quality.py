"""Where generated trajectories stop adding to the seeds: seeds of growing quality, and generators on each."""

from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from experiments.pages import Page, means, publish
from experiments.words import COLUMNS
from sidegan.pipeline.columns import OURS, columns
from sidegan.pipeline.settings import Config
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.pools import SEEDS
from sidegan.pipeline.stages.quality import added
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generators
from sidegan.pipeline.task import FACTS, Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report import figures
from sidegan.report.export import show
from sidegan.report.figures import Across, Panel
from sidegan.report.tables import over_groups, spread_if_any

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

PAPER = "ours_on_paper"  # the column of the paper's seeds
MATERIAL = 0.05  # less expected error, from which on generated trajectories count as adding something
_EVERY, _SOME, _NONE = "in every training", "in some trainings", "no"


def collect(task: Task) -> tuple[Config, pd.DataFrame]:
    """The settings, and a row per seed set and training, the poorest seeds first.

    Its columns are those of the library's report and of ``stages.quality.added``; ``seeds`` is the title of
    the seed set, and the numbers of its report begin with ``seeds_``. ``ratio`` is the median cond of the
    valid generated ones, of that of the seeds.
    """
    parts = []
    for name, column in columns(task).items():
        title = f"{task.cfg.seeds.steps} steps" if name == OURS else task.cfg.columns[name].title
        seeds = {f"seeds_{key}": x for key, x in column.report(seed_set(column)).items()}
        rows = [
            {
                "name": label,
                "training": k,
                "seeds": title,
                **seeds,
                **column.report(library(column, label, k)),
            }
            for label, k in generators(column)
        ]
        parts.append(pd.DataFrame(rows).merge(task.frame(added(task, name), FACTS), on=["name", "training"]))
    frame = pd.concat(parts).sort_values("seeds_condition", ascending=False, kind="stable")
    return task.cfg, frame.assign(ratio=frame.condition / frame.seeds_condition)


def present(collected: tuple[Config, pd.DataFrame], folder: Path, tracker: Tracker) -> None:
    """Print the tables, and write and record the page ``quality.md``."""
    cfg, frame = collected
    shown = {"added": adding(frame), "made": over_groups(frame, "seeds", COLUMNS["made"], spread_if_any)}
    for name, table in shown.items():
        show(table, f"Seeds of growing quality: {name}")
    numbers = means(frame, "seeds", [*COLUMNS["made"], *COLUMNS["added"]])
    context = {"cfg": cfg, "material": MATERIAL, "stops": stops(frame), "paper": PAPER in cfg.columns}
    page = Page("quality", shown, {"quality": figure(frame)}, numbers, context)
    publish(page, Path(cfg.publish or folder), tracker)


def adding(frame: pd.DataFrame) -> pd.DataFrame:
    """What generated trajectories add to each seed set, over trainings, and whether that counts."""
    table = over_groups(frame, "seeds", COLUMNS["added"], spread_if_any)
    return table.assign(**{"they add": [_adds(frame[frame.seeds == name]) for name in table.index]})


def stops(frame: pd.DataFrame) -> str | None:
    """The poorest seeds to which generated trajectories do not add in every training, if there are any."""
    return next(
        (str(name) for name, part in frame.groupby("seeds", sort=False) if _adds(part) != _EVERY), None
    )


def _adds(part: pd.DataFrame) -> str:
    less = part.error < 1 - MATERIAL
    return _EVERY if less.all() else _SOME if less.any() else _NONE


def figure(frame: pd.DataFrame) -> "Figure":
    """Fitness of what is generated and error of the best sets, as shares of the seeds', a dot a training."""
    shown = [
        Panel("ratio", "median cond(YᵀY), valid generated : seeds", True, {SEEDS: 1.0}),
        Panel("error", "expected error, best of both : best seeds", False, {SEEDS: 1.0}),
    ]
    across = Across("seeds_condition", "median cond(YᵀY) of the seeds", log=True)
    return figures.panels(frame, across, shown, "seeds", "training", markers=True)
