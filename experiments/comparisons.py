"""Tables of the reproduction report that belong to no experiment of their own."""

from typing import Any

import numpy as np
import pandas as pd
import torch

from experiments.artifacts import Artifacts
from experiments.words import COLUMNS, PAPER
from sidegan.base.names import plain
from sidegan.design.excitation import effective_rank, mean_distance
from sidegan.library import Library
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generator as trained
from sidegan.pipeline.stages.training import generators, surrogates
from sidegan.report import tables
from sidegan.report.style import NOT_MEASURED, number

Kinds = dict[str, tuple[dict[str, Any], Library]]


def densities(frame: pd.DataFrame) -> pd.DataFrame:
    """Kernel density estimates by bandwidth, for people."""
    return tables.formatted(frame, COLUMNS["density"]).set_index("bandwidth [Scott's]")


def longs(artifacts: Artifacts) -> pd.DataFrame:
    """How the single long trajectories were reached, for people."""
    reports = {f"{name.removeprefix('long-')} harmonics": dict(x) for name, (x, _) in artifacts.longs.items()}
    table = tables.formatted(pd.DataFrame(reports).T, COLUMNS["long"], NOT_MEASURED)
    return table.rename_axis("single long trajectory")


def durations(artifacts: Artifacts, colony: float | None = None) -> pd.DataFrame:
    """Each time of the paper's text beside ours [s], by key: what, ours, paper; NaN where not measured.

    That of a seed by the paper's optimiser is given, where there is one.
    """
    seeds, speed, task = artifacts.seeds, artifacts.speed, artifacts.task
    walls = [artifacts.seconds(trained(task, name, k)) for name, k in generators(task)]
    long = max(report["cpu_seconds"] for report, _ in artifacts.longs.values())
    rows = {
        "long": ("the single long trajectory, CPU", long),
        "seed": ("one seed, CPU", seeds["cpu_seconds"] / seeds["count"]),
        "colony": ("one seed by gaco + compass search, CPU", np.nan),
        "seeds": ("the seed set, wall", artifacts.seconds(seed_set(task))),
        "surrogates": ("the surrogates, wall", artifacts.seconds(surrogates(task, "broad"))),
        "training": ("one training, wall", float(np.mean(walls))),
        "generation": ("one generated trajectory", speed["generation_seconds"]),
        "checked": ("one valid trajectory, checked", 1 / speed["valid_per_second"]),
    }
    frame = pd.DataFrame.from_dict(rows, orient="index", columns=["what", "ours"])
    frame["paper"] = pd.Series(PAPER["seconds"], dtype=float).reindex(frame.index)
    if colony is None:
        return frame.drop(index="colony")
    frame.loc["colony", ["ours", "paper"]] = colony, frame.paper["seed"]
    return frame


def costs(frame: pd.DataFrame) -> pd.DataFrame:
    """Times beside the paper's, for people."""
    table = tables.formatted(frame.assign(ratio=frame.paper / frame.ours), COLUMNS["timing"])
    name = COLUMNS["timing"]["ours"][0]
    return table.assign(**{name: table[name].replace("—", NOT_MEASURED)}).set_index("what")


def kinds(kinds: Kinds) -> pd.DataFrame:
    """Kinds of seeds for people; diversity is compared of equally many."""
    fewest = min(len(library) for _, library in kinds.values())
    rows = {}
    for name, (report, library) in kinds.items():
        c = library.coefficients[:fewest]
        cost = report["cpu_seconds"] / report["count"]
        rows[name] = {
            "seeds": str(len(library)),
            "median cond(YᵀY)": plain(float(library.fitness.median()), ".4g"),
            "best": plain(float(library.fitness.min()), ".4g"),
            "median diagonal ratio": plain(float(library.diagonal_fitness.median()), ".4g"),
            f"mean distance of {fewest}": f"{mean_distance(c):.3g}" if fewest > 1 else "—",
            f"effective rank of {fewest}": f"{effective_rank(c):.3g}" if fewest > 1 else "—",
            "CPU per seed [s]": number(cost, ".3g"),
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("kind")


def kind_points(kinds: Kinds) -> pd.DataFrame:
    """Columns kind, quality (condition number), diversity (distance to the nearest other), a row per seed."""
    fewest = min(len(library) for _, library in kinds.values())
    parts = []
    for name, (_, library) in kinds.items():
        flat = library.coefficients[:fewest].flatten(1)
        apart = torch.cdist(flat, flat).fill_diagonal_(torch.inf).amin(1)
        quality = library.fitness[:fewest].numpy()
        parts.append(pd.DataFrame({"kind": name, "quality": quality, "diversity": apart.numpy()}))
    return pd.concat(parts)


def sensitivity(frame: pd.DataFrame, weighted: bool) -> pd.DataFrame:
    """NMSE of every set with one setting changed at a time; of a few noise draws, so that none is marked."""
    part = frame[frame.weighted == weighted]
    columns = tables.ordered(part["set"].unique())
    shown = []
    for (factor, value), group in part.groupby(["factor", "value"], sort=False):
        nmse = group.groupby(["set", "training", "repeat"]).nmse.mean().groupby("set")
        words = {str(name): tables.spread_or_dash(values) for name, values in nmse}
        cells = {tables.title(name): words.get(name, "—") for name in columns}
        shown.append({"changed": factor, "to": value, **cells})
    return pd.DataFrame(shown).set_index("changed")


def counts(frame: pd.DataFrame) -> pd.DataFrame:
    """Unweighted nMSE, mean over joints, by set, training, repeat and number of selected trajectories."""
    part = frame[(frame.factor == "count") & ~frame.weighted]
    mean = part.groupby(["set", "training", "repeat", "value"], as_index=False).nmse.mean()
    return mean.assign(trajectories=mean.value.astype(int)).sort_values("trajectories")
