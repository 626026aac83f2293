"""Variants under changes of settings, beside controls: parts of the recipe, seeds, the front of fitness."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd

from experiments import tables
from experiments.artifacts import Artifacts
from experiments.pages import FOLDER, leave, target_of
from experiments.sets import SEEDS_ORIGIN, colour
from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages.measures import variations
from sidegan.pipeline.stages.selection import SEEDS
from sidegan.pipeline.stages.training import generator
from sidegan.pipeline.tracking import Tracker
from sidegan.report.document import write_page
from sidegan.report.tables import spread

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

RECIPE, FRONT = "the recipe", "fitness "  # rows of the front: the recipe's own weight, and others
_CAPTION = (
    "Mean ± standard deviation over trainings, of which there are n. Valid share and cond(YᵀY) are of all "
    "samples, other columns of the valid ones; cond(YᵀY), ratio of the diagonal, distance and rank relative "
    "to the seeds. Coverage is of half of the seeds, by as many trajectories; row seeds: by the other half"
)
_COVERED = {"coverage": "c", "coverage_diagonal": "log diag(YᵀY)"}
_OVER = ("condition", "condition_valid", "diagonal_ratio", "distance", "rank_uncentred")  # the seeds'
_SHOWN = {
    "valid": "valid",
    "condition": "cond",
    "condition_valid": "… of the valid",
    "diagonal_ratio": "ratio of the diagonal",
    "coverage": "coverage of c",
    "coverage_diagonal": "… of log diag(YᵀY)",
    "cosine": "cosine",
    "rank_uncentred": "rank",
    "distance": "distance",
    "gain": "gain, the paper's noise",
    "gain_geometric": "… geometric",
    "gain_weighted": "… weighted",
    "gain_weighted_geometric": "… weighted, geometric",
    "gain_constant": "gain, constant noise",
    "gain_constant_geometric": "… constant, geometric",
    "cpu": "CPU [s]",
}


def collect(run: RunContext) -> dict[str, Artifacts]:
    """Artifacts of every row, by its name."""
    return {name.replace("_", " "): Artifacts(other) for name, other in variations(run).items()}


def present(rows: Mapping[str, Artifacts], folder: Path, tracker: Tracker) -> None:
    """Print, write and record the table, and the page with the front."""
    first = next(iter(rows.values())).cfg
    found = numbers(rows)
    name = first.experiment  # also of the page and its template
    shown = {name: (table(found), _CAPTION)}
    means = found.groupby(["row", "name"], sort=False)[list(_SHOWN)].mean()
    leave(folder, tracker, shown, means.set_axis([" ".join(key) for key in means.index]))
    target = target_of(name, first.publish, folder)
    figures = {"front": front(found)} if found["row"].str.startswith(FRONT).any() else {}
    origin = SEEDS_ORIGIN[first.seeds.method]
    context = {"cfg": first, "caption": _CAPTION, "rows": first.rows, "origin": origin}
    templates = [FOLDER / "templates" / f"{each}.md.j2" for each in (name, "ablation")]
    template = next(path for path in templates if path.exists())  # its own, if it has one
    write_page(template, target, {name: shown[name][0]}, figures, **context)
    tracker.log_artifact(target, "report")


def numbers(rows: Mapping[str, Artifacts]) -> pd.DataFrame:
    """Every training of every row, after the first one's controls; fitness and size are over its seeds'."""
    frames = list[pd.DataFrame]()
    for row, made in rows.items():
        every = made.generators.assign(valid=tables.valid_share(made.generators), row=row)
        of_seeds = every[every.name == SEEDS].iloc[0]
        every = every.astype({key: float for key in _SHOWN if key in every})
        for key in (key for key in _OVER if key in every):
            every[key] /= of_seeds[key.removesuffix("_valid")]
        if not frames:
            frames.append(every[~every.name.isin(made.cfg.gan)].assign(row="controls", cpu=np.nan))
        part = every[every.name.isin(made.cfg.gan)]
        each = zip(part.name, part.training.astype(int))
        cost = [made.costs(generator(made.run, *one))["cpu_seconds"] for one in each]
        frames.append(part.assign(cpu=cost))
    return pd.concat(frames, ignore_index=True).reindex(columns=["row", "name", "training", *_SHOWN])


def table(found: pd.DataFrame) -> pd.DataFrame:
    """A line for each row and variant."""
    lines = {}
    for (row, name), part in found.groupby(["row", "name"], sort=False):
        cells = {label: spread(part[key]) for key, label in _SHOWN.items()}
        lines[row, name] = {"n": len(part)} | cells
    frame = pd.DataFrame.from_dict(lines, orient="index")
    frame.index = pd.MultiIndex.from_tuples(frame.index, names=["changed", "variant"])
    return frame


def front(found: pd.DataFrame) -> "Figure":
    """Invalid share, and both coverages, against the condition number: eigen over its weight, and vanilla."""
    from sidegan.report.canvas import blank, from_zero, legend, letter, logarithmic, tidy

    found = found.assign(invalid=1 - found.valid)
    weights = found["row"].str.removeprefix(FRONT).where(found["row"].str.startswith(FRONT))
    of_eigen = found[(weights.notna() | (found["row"] == RECIPE)) & (found.name == "eigen")]
    of_vanilla = found[(found["row"] == RECIPE) & (found.name == "vanilla")]
    figure, handles = blank(10, 3.6), {}
    panels = {"invalid": "invalid share"} | {key: f"coverage of {of}" for key, of in _COVERED.items()}
    axes = figure.subplots(1, 3)
    for axis, (key, label) in zip(axes, panels.items()):
        for name, part in (("eigen", of_eigen), ("vanilla", of_vanilla)):
            handles[name] = axis.scatter(part.condition, part[key], s=14, color=colour(name), alpha=0.5)
        means = of_eigen.groupby("row")[["condition", key]].mean().sort_values("condition")
        axis.plot(means.condition, means[key], color=colour("eigen"), lw=1)
        for row, at, height in means.itertuples():
            words = row.removeprefix(FRONT) if row != RECIPE else "recipe"
            axis.annotate(words, (at, height), (4, 4), textcoords="offset points", fontsize=7)
        if key == "invalid":
            from_zero(axis, pd.concat([of_eigen, of_vanilla])[key])
        else:
            axis.set_ylim(0, 1)
        logarithmic(axis, "x")
        axis.set_xlabel("median cond(YᵀY) over the seeds'", fontsize=9)
        axis.set_ylabel(label, fontsize=9)
        tidy(axis)
    letter(axes)
    legend(figure, handles)
    return figure
