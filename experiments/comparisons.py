"""Tables of the reproduction report that belong to no other experiment."""

from collections.abc import Mapping

import numpy as np
import pandas as pd

from experiments.artifacts import Artifacts
from experiments.reference import COLUMNS, PAPER
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import generator as trained
from sidegan.pipeline.stages.training import generators, surrogates
from sidegan.report import tables
from sidegan.report.style import NOT_MEASURED

_ON_BOX = 1e-3  # share of the largest coefficient
_AT_LIMIT = 0.01  # rad


def seed_sets(artifacts: Mapping[str, Artifacts]) -> pd.DataFrame:
    """Table of the seed sets by condition."""
    table = pd.DataFrame({name: seed_facts(results) for name, results in artifacts.items()}).T
    return tables.formatted(table, COLUMNS["seeds"]).rename_axis("condition")


def seed_facts(artifacts: Artifacts) -> dict[str, float]:
    """Numbers that characterise a seed set."""
    library = artifacts.run.load(seed_set(artifacts.run))
    c = library.coefficients
    margin = library.margins["position"]
    on_box = np.abs(c) > (1 - _ON_BOX) * np.abs(c).max()
    lower, middle, upper = np.quantile(library.fitness, [0.25, 0.5, 0.75])
    kept = ("count", "diagonal_ratio", "distance", "rank")
    return {key: float(artifacts.seeds[key]) for key in kept} | {
        "condition": middle,
        "lower": lower,
        "upper": upper,
        "mean": float(np.abs(c).mean()),
        "a_on_box": float(on_box[..., 0].mean()),
        "b_on_box": float(on_box[..., 1].mean()),
        "at_limit": float((margin < _AT_LIMIT).mean()),
        "seconds": artifacts.seed_seconds,
    }


def densities(frame: pd.DataFrame) -> pd.DataFrame:
    """Table of kernel density estimates by bandwidth."""
    return tables.formatted(frame, COLUMNS["density"]).set_index("bandwidth [Scott's]")


def longs(artifacts: Artifacts) -> pd.DataFrame:
    """Table of the searches for the single long trajectories."""
    reports = {f"{name.removeprefix('long-')} harmonics": dict(x) for name, (x, _) in artifacts.longs.items()}
    table = tables.formatted(pd.DataFrame(reports).T, COLUMNS["long"], NOT_MEASURED)
    return table.rename_axis("single long trajectory")


def timing(artifacts: Artifacts) -> pd.DataFrame:
    """Table of the times in the paper's text, and ours."""
    speed, run, seed = artifacts.speed, artifacts.run, artifacts.seed_seconds
    trainings = [artifacts.costs(trained(run, *generator))["cpu_seconds"] for generator in generators(run)]
    long = max(report["cpu_seconds"] for report, _ in artifacts.longs.values())
    rows = {
        "long": ("the single long trajectory, CPU", long),
        "seed": ("one seed, CPU", seed),
        "seeds": ("the seed set, CPU", seed * run.cfg.seeds.count),
        "surrogates": ("the surrogates, CPU", artifacts.costs(surrogates(run))["cpu_seconds"]),
        "training": ("one training, CPU", float(np.mean(trainings))),
        "generation": ("one generated trajectory", speed["generation_seconds"]),
        "checked": ("one valid trajectory, checked", 1 / speed["valid_per_second"]),
    }
    frame = pd.DataFrame.from_dict(rows, orient="index", columns=["what", "ours"])
    frame["paper"] = pd.Series(PAPER["seconds"], dtype=float)
    table = tables.formatted(frame.assign(ratio=frame.paper / frame.ours), COLUMNS["timing"])
    ours = COLUMNS["timing"]["ours"][0]
    return table.assign(**{ours: table[ours].replace("—", NOT_MEASURED)}).set_index("what")
