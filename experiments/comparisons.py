"""Tables of the reproduction report that belong to no experiment of their own."""

from typing import Any

import numpy as np
import pandas as pd
import torch

from experiments.artifacts import Evidence, History
from sidegan.design.excitation import effective_rank, mean_distance
from sidegan.report import tables

_LAST = {
    "success": "valid share",
    "condition": "median cond(YᵀY)",
    "distance": "mean distance",
    "rank": "effective rank",
    "distance_diagonal": "mean distance of diag(YᵀY)",
}


def last_epoch(runs: dict[str, list[History]]) -> pd.DataFrame:
    """Metrics after the last epoch, a row per variant and training."""
    rows = [
        {"variant": name, "training": k, **history[-1]}
        for name, histories in runs.items()
        for k, history in enumerate(histories)
    ]
    return pd.DataFrame(rows)


def ablation(evidence: Evidence) -> pd.DataFrame:
    """What each part of the recipe does, over trainings."""
    frame = last_epoch(evidence.ablation)
    early = {
        name: [h[min(9, len(h) - 1)]["success"] for h in histories]
        for name, histories in evidence.ablation.items()
    }
    rows = {}
    for name, part in frame.groupby("variant", sort=False):
        row = {label: tables.spread_or_dash(part[key]) for key, label in _LAST.items()}
        rows[name] = {"valid after 10 epochs": tables.spread_or_dash(pd.Series(early[str(name)])), **row}
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("variant")


def subsets(evidence: Evidence) -> pd.DataFrame:
    """Metrics after the last epoch against the number of seeds, a row per size, variant and training."""
    frames = [last_epoch(runs).assign(seeds=size) for size, runs in evidence.subsets.items()]
    return pd.concat(frames, ignore_index=True)


def densities(evidence: Evidence) -> pd.DataFrame:
    """Kernel density estimates by bandwidth, for people."""
    frame = evidence.density
    table = pd.DataFrame(
        {
            "bandwidth [Scott's]": frame.bandwidth.map("{:g}".format),
            "valid share": frame.success.map("{:.4f}".format),
            "median cond(YᵀY)": frame.condition.map("{:.3g}".format),
            "mean distance": frame.distance.map("{:.3g}".format),
            "distance to the nearest seed": frame.from_seed.map("{:.3g}".format),
        }
    )
    return table.set_index("bandwidth [Scott's]")


def costs(frame: pd.DataFrame) -> pd.DataFrame:
    """Times beside the paper's, for people."""
    ratio = frame.paper / frame.ours
    table = pd.DataFrame(
        {
            "what": frame.what,
            "ours [s]": frame.ours.map("{:.3g}".format),
            "paper [s]": frame.paper.map(lambda x: "—" if np.isnan(x) else f"{x:.3g}"),
            "times faster": ratio.map(lambda x: "—" if np.isnan(x) else f"{x:,.0f}"),
        }
    )
    return table.set_index("what")


def kinds(evidence: Evidence) -> tuple[pd.DataFrame, pd.DataFrame]:
    """Kinds of seeds for people, and a point per seed: kind, condition, distance to the nearest other."""
    task = evidence.task
    stamps = {"gradient": task.seeds} | {name: task.kind(name).seeds for name in task.cfg.kinds}
    fewest = min(map(len, evidence.kinds.values()))
    rows, points = {}, []
    for name, library in evidence.kinds.items():
        report, c = evidence.report(stamps[name]), library.coefficients[:fewest]
        rows[name] = {
            "seeds": str(len(library)),
            "median cond(YᵀY)": f"{library.fitness.median():.4g}",
            "best": f"{library.fitness.min():.4g}",
            "median diagonal ratio": f"{library.diagonal_fitness.median():.4g}",
            f"mean distance of {fewest}": f"{mean_distance(c):.3g}" if fewest > 1 else "—",
            f"effective rank of {fewest}": f"{effective_rank(c):.3g}" if fewest > 1 else "—",
            "CPU per seed [s]": f"{report['cpu_seconds'] / report['count']:.3g}",
        }
        points.append(_points(name, c, library.fitness[:fewest]))
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("kind"), pd.concat(points)


def _points(kind: str, c: torch.Tensor, fitness: torch.Tensor) -> pd.DataFrame:
    apart = torch.cdist(c.flatten(1), c.flatten(1)).fill_diagonal_(torch.inf).amin(1)
    return pd.DataFrame({"kind": kind, "condition": fitness.numpy(), "nearest": apart.numpy()})


def sensitivity(frame: pd.DataFrame, weighted: bool) -> pd.DataFrame:
    """NMSE of every set with one setting changed at a time; the smallest of a row is marked."""
    part = frame[frame.weighted == weighted]
    rows: dict[tuple[str, str], dict[str, Any]] = {}
    for (factor, value, name), group in part.groupby(["factor", "value", "set"], sort=False):
        mean = group.groupby(["training", "repeat"]).nmse.mean()
        rows.setdefault((str(factor), str(value)), {})[str(name)] = mean
    columns = tables.ordered({name for row in rows.values() for name in row})
    shown = []
    for (factor, value), row in rows.items():
        best = min(row, key=lambda name: row[name].mean())
        words = {name: tables.spread_or_dash(row.get(name)) for name in columns}
        words[best] = f"**{words[best]}**"
        cells = {tables.title(name): text for name, text in words.items()}
        shown.append({"changed": factor, "to": value, **cells})
    return pd.DataFrame(shown).set_index("changed")
