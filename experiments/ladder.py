"""From the paper's recipe to ours, one change at a time, and ours without each of its parts."""

from collections.abc import Iterable, Mapping
from dataclasses import asdict
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from experiments.pages import Page, means, publish
from experiments.words import COLUMNS
from sidegan.base.names import plain
from sidegan.gan import Variant
from sidegan.pipeline.graph import Artifact, differing
from sidegan.pipeline.settings import Config
from sidegan.pipeline.stages import ladder
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.export import show
from sidegan.report.tables import over_groups

_BETTER = {"success": 1, "rank": 1, "condition_valid": -1}  # measures of steps, and which way they are better
_LAST, _REPAIR = "ours", "repaired"  # of the way, and the first of those beside it
_VALID = 0.5


class Step(NamedTuple):
    """A rung, with a measure before and after it."""

    rung: str
    before: float
    after: float


def collect(task: Task) -> Task:
    """The task, whose rungs are read when they are shown."""
    return task


def present(task: Task, folder: Path, tracker: Tracker) -> None:
    """Print what the generators of each rung make, over trainings, and write and record ``ladder.md``."""
    every, without = rows(task), parts(task)
    whole = _table(every, changes(task.cfg))
    tables = {
        "ladder": whole.loc[:_REPAIR],
        "repair": whole.loc[_REPAIR:].rename_axis("repaired, but"),
        "parts": _table(without, changes_of_ours(task.cfg)).rename_axis("ours, but"),
    }
    told = "of the kept epoch, true physics, no sample filtered"
    show(tables["ladder"], f"From the paper's recipe to ours: {told}")
    show(tables["repair"], f"The repair with one part changed at a time: {told}")
    show(tables["parts"], f"Ours with one part changed at a time: {told}")
    numbers = means(pd.concat([every, without]), "rung", COLUMNS["ladder"])
    context = {"cfg": task.cfg, "steps": largest_steps(every)}
    page = Page("ladder", tables, {}, numbers, context)
    publish(page, Path(task.cfg.publish or folder), tracker)


def largest_steps(every: pd.DataFrame) -> dict[str, Step]:
    """The largest step between neighbouring rungs of each measure, on the way to the last one of the ladder.

    Rungs after ``ours`` are shortcuts and no part of the way. How diverse and how exciting samples are counts
    where most of them are valid.
    """
    of_rungs = every.groupby("rung", sort=False)[list(_BETTER)].mean().drop(index="seeds").loc[:_LAST]
    found = {}
    for name, sign in _BETTER.items():
        known = of_rungs.loc[(of_rungs.success >= _VALID) | (name == "success"), name].dropna()
        before, after = known.to_numpy()[:-1], known.to_numpy()[1:]
        gains = after - before if sign > 0 else np.log(before / after)
        if len(gains):
            place = int(gains.argmax())
            found[name] = Step(str(known.index[place + 1]), float(before[place]), float(after[place]))
    return found


def changes(cfg: Config) -> dict[str, str]:
    """What a rung changes: of the one before it, the repair of the first, those after it of the repair."""
    names = list(cfg.ladder)
    way, less = names[: names.index(_REPAIR)], names[names.index(_REPAIR) + 1 :]
    before = {**dict(zip(way[1:], way, strict=False)), _REPAIR: way[0], **dict.fromkeys(less, _REPAIR)}
    return {name: changed(cfg.ladder[of], cfg.ladder[name]) for name, of in before.items()}


def changes_of_ours(cfg: Config) -> dict[str, str]:
    """What each variant of ours changes of it."""
    ours = cfg.ladder[_LAST]
    return {name: changed(ours, one) for name, one in cfg.ablation.items()}


def changed(before: Variant, after: Variant) -> str:
    """The settings in which a variant differs from another, with their new values."""
    both = differing(asdict(before), asdict(after))
    return ", ".join(f"{key} {_value(x)}" for key, (_, x) in both.items())


def _value(x: Any) -> str:
    words = {None: "none", True: "yes", False: "no"}
    if isinstance(x, list | tuple):
        return " and ".join(map(_value, x))
    return words[x] if x is None or isinstance(x, bool) else plain(x) if isinstance(x, float) else str(x)


def _table(frame: pd.DataFrame, told: Mapping[str, str]) -> pd.DataFrame:
    table = over_groups(frame, "rung", COLUMNS["ladder"])
    table.insert(0, "changed", [told.get(str(name), "—") for name in table.index])
    return table


def rows(task: Task) -> pd.DataFrame:
    """A row for the seeds, and one per rung and training."""
    rows = [{"rung": "seeds", "success": 1.0, **task.report(seed_set(task))}]
    rows[0]["condition_valid"] = rows[0]["condition"]
    return pd.DataFrame(rows + _reports(task, ladder.rungs(task)))


def parts(task: Task) -> pd.DataFrame:
    """A row per training of ours, and of ours with each part changed."""
    ours = ladder.rungs(task)[_LAST]
    return pd.DataFrame(_reports(task, {_LAST: ours} | ladder.parts(task)))


def _reports(task: Task, made: Mapping[str, Iterable[Artifact]]) -> list[dict[str, Any]]:
    return [{"rung": name, **task.report(one)} for name, some in made.items() for one in some]
