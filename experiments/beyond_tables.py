"""Tables of the page on exact physics, for people."""

import numpy as np
import pandas as pd

from experiments.artifacts import RANDOM, SEEDS
from experiments.artifacts_beyond import (
    GREEDY,
    NARROW,
    OPTIMAL,
    OPTIMISED,
    POLISHED,
    SCRATCH,
    BeyondArtifacts,
)
from experiments.beyond_even import break_even
from experiments.words import COLUMNS
from sidegan.report import tables
from sidegan.report.style import NOT_MEASURED

GOOD, NEAR = 0.97, 1.1  # valid share and factor of the final condition number that are "the same quality"
_TITLES = {
    RANDOM: "random valid",
    SEEDS: "optimised seeds",
    OPTIMISED: "optimised, little reserve",
    NARROW: "seeds, blurred",
    POLISHED: "exact, polished",
}
_FIRST_ROWS = (RANDOM, SEEDS, OPTIMISED, NARROW)
_TARGETS = {"another_arm": "another arm", "tool": "a tool", "higher_desk": "a higher desk"}


def shown(artifacts: BeyondArtifacts) -> dict[str, pd.DataFrame]:
    """Every table of the page whose part was run, by name."""
    best = artifacts.best
    parts = {
        "pools": by_pool(artifacts.pools, "pools"),
        "first": first(artifacts.first_times),
        "best_D_optimal": by_pool(best[best.pick == OPTIMAL], "best"),
        "best_greedy": by_pool(best[best.pick == GREEDY], "best"),
    }
    if len(polish := artifacts.polish):
        parts["polish"] = _formatted(polish.assign(seconds=1000 * polish.seconds), "polish")
        even = break_even(artifacts)
        parts["even"] = _formatted(even.assign(ours=1000 * even.ours, theirs=1000 * even.theirs), "even")
    if len(objectives := artifacts.objectives):
        named = objectives.assign(name=objectives.name.str.removeprefix("exact_"))
        parts["objectives"] = _formatted(named, "objectives")
    if len(artifacts.few):
        keys = ["variant", "seeds"]
        parts["few"] = tables.over_groups(
            artifacts.few.sort_values(keys), keys, COLUMNS["few"], tables.spread_if_any
        )
        parts["few"] = parts["few"].reset_index("seeds")
    if len(artifacts.transfers):
        parts["transfer"] = transfers(artifacts.transfers)
    return parts


def first(times: pd.DataFrame) -> pd.DataFrame:
    """Where the time to the first set goes, over trainings."""
    frame = times.replace(0.0, np.nan)  # what was not needed
    table = by_pool(frame.assign(each=1000 * frame.each), "first")
    always = [COLUMNS["first"][key] for key in ("drawing", "total")]
    return table.assign(**{name: table[name].replace("—", NOT_MEASURED) for name in always})


def transfers(frame: pd.DataFrame) -> pd.DataFrame:
    """What each way reaches for each target, and how soon it has the quality of the training from scratch."""
    rows = []
    for (target, way), curve in frame.groupby(["target", "way"], sort=False):
        steps, seconds = arrival(curve, final_condition(frame[frame.target == target]))
        row = {**curve.iloc[-1], "target": called(str(target)), "way": way}
        row |= {"steps_to": steps, "seconds_to": seconds}
        if curve.steps.iloc[0] == 0:
            row |= {f"{key}_before": curve[key].iloc[0] for key in ("success", "condition")}
        rows.append(row)
    table = _formatted(pd.DataFrame(rows), "transfer")
    never = pd.DataFrame(rows).steps_to.isna().to_numpy()
    for key in ("steps_to", "seconds_to"):
        name = COLUMNS["transfer"][key][0]
        table[name] = np.where(never, "never", table[name].replace("—", NOT_MEASURED))
    return table


def arrival(curve: pd.DataFrame, final: float) -> tuple[float, float]:
    """Steps and seconds after which a training first has the quality; NaN when it never has.

    Args:
        curve: rows of one training.
        final: median condition number at the end of the training from scratch.
    """
    good = curve[(curve.success >= GOOD) & (curve.condition <= NEAR * final)]
    return (np.nan, np.nan) if good.empty else (float(good.steps.min()), float(good.seconds.min()))


def final_condition(part: pd.DataFrame) -> float:
    """Median condition number at the end of the training from scratch for one target."""
    return float(part[part.way == SCRATCH].condition.iloc[-1])


def called(target: str) -> str:
    """Name of a target for people."""
    return _TARGETS.get(target, target)


def title(name: str) -> str:
    """Name of a pool for people."""
    return _TITLES.get(name, name)


def by_pool(frame: pd.DataFrame, name: str) -> pd.DataFrame:
    """A row per pool, over trainings: what was not generated comes first."""
    table = tables.over_groups(frame, "name", COLUMNS[name], tables.spread_if_any)
    generated = [name for name in tables.ordered(table.index) if name not in _FIRST_ROWS]
    names = [name for name in (*_FIRST_ROWS, *generated) if name in table.index]
    return table.loc[names].rename(index=title).rename_axis("from")


def _formatted(frame: pd.DataFrame, name: str) -> pd.DataFrame:
    """Columns for people, the first of which names the rows."""
    table = tables.formatted(frame, COLUMNS[name])
    return table.set_index(table.columns[0])
