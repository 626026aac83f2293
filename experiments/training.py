"""Figure 3: success, fitness and diversity of every variant against epoch, by exact physics.

Source: Jegorova et al. 2020, section V-B.
"""

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments import figures, tables
from experiments.artifacts import Artifacts
from experiments.pages import leave
from experiments.sets import sort_sets
from experiments.verdicts import TRAINING
from sidegan.base.arrays import flatten
from sidegan.base.names import counted
from sidegan.pipeline.stages.baselines import searched_sets
from sidegan.pipeline.stages.measures import together
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import SEEDS
from sidegan.pipeline.tracking import Tracker
from sidegan.report import motion
from sidegan.report.tables import formatted, spread

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

RELIABLE = 0.8  # our reading of "reliably generate successful trajectories": least valid share
EARLY, LATE = 10, 40  # epoch of that statement; first epoch of the paper's comparisons
_GENERATORS = (
    "Seeds, baselines and generators after the last epoch, by the true physics: valid share and median "
    "cond(YᵀY) of all samples, other columns of the valid ones. Gain: expected error of {count} random "
    "seeds over that of {count} random members of the set; natural: random draws in natural coordinates"
)
BESIDE = "The same sets, compared in equal numbers with one half of the seeds (row seeds: the other half)"
SEARCHED = (
    "Search or generator: CPU time of a searched trajectory, and from how many trajectories on a generator "
    "has cost less, with its seeds, surrogates and training, which are paid once"
)
_MEANS = ("valid", *tables.WORTH, *tables.LIKENESS)
_LEAST = 1e-30  # lower bound of diag(YᵀY), which is zero for a column without excitation
_MOVED, _TIMES = 3, 6  # trajectories along which the arm is shown, and times

collect = Artifacts


def present(artifacts: Artifacts, folder: Path, tracker: Tracker) -> None:
    """Print, write and record the figure and its tables."""
    histories, cfg = artifacts.histories, artifacts.cfg
    over = f"{counted(len(cfg.trainings), 'training')}, {cfg.evaluation} samples per epoch"
    shown = {
        "generators": (
            tables.generator_table(artifacts.generators),
            f"{caption(artifacts)} ({over})",
        ),
        "likeness": (tables.likeness_table(artifacts.generators), BESIDE),
        "searches": (searched(artifacts), SEARCHED),
        "epochs": (speed(histories), f"Epochs to a valid share of {RELIABLE:.0%}"),
    }
    drawn = {"training": figure(histories, artifacts.as_many_seeds), **pictures(artifacts)}
    leave(folder, tracker, shown, summary(artifacts.generators), drawn)


def caption(artifacts: Artifacts) -> str:
    """Caption of the table of generators."""
    return _GENERATORS.format(count=together(artifacts.run))


def summary(generators: pd.DataFrame) -> pd.DataFrame:
    """Worth of generators, baselines and seeds, mean over trainings, for the table of a sweep."""
    return means(generators).rename(columns={"valid": "valid share", **tables.WORTH, **tables.LIKENESS})


def searched(artifacts: Artifacts) -> pd.DataFrame:
    """What searched trajectories cost, and from which number of them on each generator has cost less."""
    seeds, first = artifacts.seed_seconds * artifacts.cfg.seeds.count, artifacts.cfg.trainings[0]
    once = {
        name: seeds * variant.seeded + artifacts.training_seconds(name, first)
        for name, variant in artifacts.cfg.gan.items()
    }
    rows = {}
    for name, made in searched_sets(artifacts.run).items():
        each = artifacts.costs(made)["cpu_each"]
        rows[name] = {"each": 1e3 * each} | {key: cost / each for key, cost in once.items()}
    columns = {"each": ("CPU [ms]", ".3g")} | {key: (key, ".3g") for key in once}
    return formatted(pd.DataFrame.from_dict(rows, orient="index"), columns).rename_axis("search")


def means(generators: pd.DataFrame) -> pd.DataFrame:
    """Validity, worth and likeness, mean over trainings; a row a generator, baseline, and the seeds."""
    frame = generators.assign(valid=tables.valid_share(generators))
    numbers = frame[[key for key in _MEANS if key in frame]].astype(float)
    return numbers.groupby(frame["name"], sort=False).mean()


def pictures(artifacts: Artifacts) -> dict[str, "Figure"]:
    """Seeds beside each generator's first training, and the arm along trajectories of one, by name."""
    first, run = artifacts.cfg.trainings[0], artifacts.run
    made = {name: artifacts.generated(name, first) for name in artifacts.cfg.gan}
    sets = {SEEDS: run.load(seed_set(run)), **made}
    spaces = {
        "coefficients [rad/s]": {name: flatten(x.coefficients, 1) for name, x in sets.items()},
        "log diag(YᵀY)": {name: np.log(np.maximum(x.diagonal, _LEAST)) for name, x in sets.items()},
    }
    shown = made.get("eigen", next(iter(made.values()))).coefficients[:_MOVED]
    poses = motion.poses(run.cell.arm, run.cell.trajectory, shown, _TIMES)
    return {"likeness": figures.clouds(spaces), "poses": poses}


def figure(
    histories: pd.DataFrame, seeds: dict[str, float], union: dict[str, float] | None = None
) -> "Figure":
    """Metrics after every epoch, the seeds' dashed, and those of seeds and generated ones together."""
    invalid = histories.assign(invalid=1 - histories.success)
    references = {SEEDS: seeds | {"invalid": 1 - seeds["success"]}, "union": union or {}}
    return figures.panels(invalid, references)


def speed(histories: pd.DataFrame) -> pd.DataFrame:
    """First epoch with a reliable generator, and its best, late and last valid shares.

    Shares of epochs that a training did not reach are missing.
    """
    rows = {}
    for name, part in histories.groupby("variant", sort=False):
        share = part.pivot(index="epoch", columns=TRAINING, values="success").fillna(0.0)
        reached = share >= RELIABLE
        first = ["never" if pd.isna(x) else f"{x:g}" for x in reached.idxmax().where(reached.any())]
        rows[name] = {
            "first epoch": ", ".join(f"{x} ({n} ×)" if n > 1 else x for x, n in Counter(first).items()),
            f"valid after {EARLY} epochs": spread(share.loc[EARLY:EARLY].mean()),
            "best": spread(share.max()),
            f"mean from epoch {LATE} on": spread(share.loc[LATE:].mean()),
            "last": spread(share.iloc[-1]),
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("variant")


def sizes(subsets: pd.DataFrame) -> pd.DataFrame:
    """Valid share after the last epoch, by variant and number of seeds."""
    kept = subsets[subsets.kept]
    table = kept.groupby(["variant", "seeds"]).success.agg(spread).unstack("seeds").fillna("—")
    return table.loc[sort_sets(table.index)].rename(columns="{} seeds".format)
