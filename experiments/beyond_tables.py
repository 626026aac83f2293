"""Tables of the page on exact physics, for people."""

import numpy as np
import pandas as pd

from experiments.artifacts import RANDOM, SEEDS
from experiments.artifacts_beyond import OPTIMISED, POLISHED
from experiments.beyond_frames import arrival, final_condition
from sidegan.report import tables

_POOLS = {
    "success": "valid share",
    "condition": "median cond(YᵀY)",
    "best": "best cond(YᵀY)",
    "distance": "mean distance",
    "rank": "effective rank",
    "nearest": "nearest distance",
    "distance_diagonal": "mean distance of diag(YᵀY)",
}
_BEST = {
    "condition": "cond of the stack",
    "log_det": "log det",
    "covariance_norm": "‖diag P‖",
    "nmse": "nMSE",
    "nmse_weighted": "nMSE, weighted",
    "energy": "energy [J]",
    "speed": "peak velocity",
}
_FIRST = {
    "seeds": "seeds [s]",
    "surrogates": "surrogates [s]",
    "wall": "training, wall [s]",
    "cpu": "training, CPU [s]",
    "drawing": "the set itself [s]",
    "total": "together [s]",
    "each": "one more [ms]",
}
_OBJECTIVES = {
    "name": ("objective", ""),
    "success": ("valid share", ".3f"),
    "condition_one": ("median cond of one", ".4g"),
    "distance": ("mean distance", ".3g"),
    "rank": ("effective rank", ".3g"),
    "pick": ("pick", ""),
    "condition": ("cond of the stack", ".4g"),
    "log_det": ("log det", ".4g"),
    "covariance_norm": ("‖diag P‖", ".3g"),
}
_POLISH = {
    "start": ("start", ""),
    "steps": ("steps", ""),
    "seconds": ("CPU per valid trajectory [ms]", ".3g"),
    "success": ("valid share", ".3f"),
    "condition": ("median cond(YᵀY)", ".4g"),
    "distance": ("mean distance", ".3g"),
    "rank": ("effective rank", ".3g"),
}
_TITLES = {
    RANDOM: "random valid",
    SEEDS: "optimised seeds",
    OPTIMISED: "optimised, little reserve",
    POLISHED: "exact, polished",
}
_FIRST_ROWS = (RANDOM, SEEDS, OPTIMISED)
_TARGETS = {"another_arm": "another arm", "tool": "a tool", "higher_desk": "a higher desk"}


def spread(values: pd.Series | None) -> str:
    """Mean ± deviation, the value alone where all are alike; a dash where nothing is known."""
    finite = pd.Series(values, dtype=float).replace([np.inf, -np.inf], np.nan).dropna()
    if finite.nunique() == 1:
        return f"{finite.iloc[0]:.3g}"
    return tables.spread_or_dash(finite)


def pools(frame: pd.DataFrame) -> pd.DataFrame:
    """Validity, excitation and diversity of every pool, over trainings."""
    return _table(frame, _POOLS)


def best(frame: pd.DataFrame, pick: str) -> pd.DataFrame:
    """What the best set of every pool is worth, over trainings."""
    return _table(frame[frame.pick == pick], _BEST)


def first(times: pd.DataFrame) -> pd.DataFrame:
    """Where the time to the first set goes, over trainings."""
    frame = times.replace(0.0, np.nan)  # what was not needed
    return _table(frame.assign(each=1000 * frame.each), _FIRST)


def objectives(frame: pd.DataFrame) -> pd.DataFrame:
    """What each objective makes, a row per objective and pick."""
    named = frame.assign(name=frame.name.str.removeprefix("exact_"))
    return tables.formatted(named, _OBJECTIVES).set_index("objective")


def few(frame: pd.DataFrame) -> pd.DataFrame:
    """Validity, excitation and diversity against the number of seeds."""
    labels = {key: _POOLS[key] for key in ("success", "condition", "distance", "rank")}
    table = tables.over_groups(frame.sort_values(["variant", "seeds"]), ["variant", "seeds"], labels, spread)
    return table.reset_index("seeds")


def polish(frame: pd.DataFrame) -> pd.DataFrame:
    """The polish curve and that of the optimiser."""
    return tables.formatted(frame.assign(seconds=1000 * frame.seconds), _POLISH).set_index("start")


def transfers(frame: pd.DataFrame) -> pd.DataFrame:
    """What each way reaches for each target, and how soon it has the quality of the training from scratch."""
    rows = []
    for target, part in frame.groupby("target", sort=False):
        final = final_condition(part)
        for way, curve in part.groupby("way", sort=False):
            steps, seconds = arrival(curve, final)
            last, begun = curve.iloc[-1], curve.iloc[0]
            rows.append(
                {
                    "target": called(str(target)),
                    "way": way,
                    "steps": f"{last.steps:g}",
                    "valid before": f"{begun.success:.3f}" if begun.steps == 0 else "—",
                    "cond before": f"{begun.condition:.4g}" if begun.steps == 0 else "—",
                    "valid after": f"{last.success:.3f}",
                    "cond after": f"{last.condition:.4g}",
                    "steps to the same": "never" if np.isnan(steps) else f"{steps:g}",
                    "seconds to the same": "never" if np.isnan(seconds) else f"{seconds:.3g}",
                }
            )
    return pd.DataFrame(rows).set_index("target")


def called(target: str) -> str:
    """Name of a target for people."""
    return _TARGETS.get(target, target)


def _table(frame: pd.DataFrame, labels: dict[str, str]) -> pd.DataFrame:
    """A row per pool: what was not generated comes first."""
    table = tables.over_groups(frame, "name", labels, spread)
    generated = [name for name in tables.ordered(table.index) if name not in _FIRST_ROWS]
    names = [name for name in (*_FIRST_ROWS, *generated) if name in table.index]
    return table.loc[names].rename(index=title).rename_axis("from")


def title(name: str) -> str:
    """Name of a pool for people."""
    return _TITLES.get(name, name)
