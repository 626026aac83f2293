"""Tables of the page on exact physics, for people."""

import numpy as np
import pandas as pd

from experiments.beyond_frames import arrival, final_condition
from sidegan.pipeline.plan import RANDOM, SEEDS
from sidegan.pipeline.plan_beyond import OPTIMISED, POLISHED
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
_TITLES = {
    RANDOM: "random valid",
    SEEDS: "optimised seeds",
    OPTIMISED: "optimised, little reserve",
    POLISHED: "exact, polished",
}
_FIRST_ROWS = (RANDOM, SEEDS, OPTIMISED)
_TARGETS = {"another_arm": "another arm", "tool": "a tool", "higher_desk": "a higher desk"}


def spread(values: pd.Series) -> str:
    """Mean ± deviation, the value alone where all are alike; a dash where nothing is known."""
    known = values.replace([np.inf, -np.inf], np.nan).dropna()
    if known.nunique() == 1:
        return f"{known.iloc[0]:.3g}"
    return tables.spread_or_dash(known)


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
    rows = [
        {
            "objective": row["name"].removeprefix("exact_"),
            "valid share": f"{row['success']:.3f}",
            "median cond of one": f"{row['condition_one']:.4g}",
            "mean distance": f"{row['distance']:.3g}",
            "effective rank": f"{row['rank']:.3g}",
            "pick": row["pick"],
            "cond of the stack": f"{row['condition']:.4g}",
            "log det": f"{row['log_det']:.4g}",
            "‖diag P‖": f"{row['covariance_norm']:.3g}",
        }
        for row in frame.to_dict("records")
    ]
    return pd.DataFrame(rows).set_index("objective")


def few(frame: pd.DataFrame) -> pd.DataFrame:
    """Validity, excitation and diversity against the number of seeds."""
    labels = {key: _POOLS[key] for key in ("success", "condition", "distance", "rank")}
    rows = [
        {"variant": name, "seeds": size, **{label: spread(part[key]) for key, label in labels.items()}}
        for (name, size), part in frame.groupby(["variant", "seeds"], sort=True)
    ]
    return pd.DataFrame(rows).set_index("variant")


def polish(frame: pd.DataFrame) -> pd.DataFrame:
    """The polish curve and that of the optimiser."""
    table = pd.DataFrame(
        {
            "start": frame.start,
            "steps": frame.steps,
            "CPU per valid trajectory [ms]": (1000 * frame.seconds).map("{:.3g}".format),
            "valid share": frame.success.map("{:.3f}".format),
            "median cond(YᵀY)": frame.condition.map("{:.4g}".format),
            "mean distance": frame.distance.map("{:.3g}".format),
            "effective rank": frame["rank"].map("{:.3g}".format),
        }
    )
    return table.replace("nan", "—").set_index("start")


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
    groups = {str(name): part for name, part in frame.groupby("name")}
    rows = {
        title(name): {label: spread(groups[name][key]) for key, label in labels.items() if key in frame}
        for name in sorted(tables.ordered(groups), key=lambda name: _place(name))
    }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("from")


def _place(name: str) -> int:
    """What was not generated comes first."""
    return _FIRST_ROWS.index(name) if name in _FIRST_ROWS else len(_FIRST_ROWS)


def title(name: str) -> str:
    """Name of a pool for people."""
    return _TITLES.get(name, name)
