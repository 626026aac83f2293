"""Exact physics in the loop beside surrogates, plain optimisation and chance: the page ``beyond.md``."""

from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd

from experiments import beyond_goals, beyond_tables, beyond_words
from experiments.artifacts import SEEDS
from experiments.artifacts_beyond import GREEDY, OPTIMAL, BeyondArtifacts
from experiments.beyond_frames import first_times, progress, summary
from experiments.pages import Page, publish
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.figures import Across, panels
from sidegan.report.figures import metrics as metric_panels

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

_SHOWN = ("success", "condition", "distance", "rank")
_COMPARED = ("success", "condition", "distance", "rank", "stack", "covariance_norm", "nmse", "nmse_weighted")


def collect(task: Task) -> BeyondArtifacts:
    """What the page is made from.

    Raises:
        ConfigError: when the variant that all is compared with is not trained.
    """
    artifacts = BeyondArtifacts(task)
    _ = artifacts.source
    return artifacts


def present(artifacts: BeyondArtifacts, folder: Path, tracker: Tracker) -> None:
    """Write ``beyond.md``, its tables, figures and metrics; record the page."""
    measures = summary(artifacts)
    judged = beyond_goals.goals(artifacts)
    context = {
        "artifacts": artifacts,
        "cfg": artifacts.cfg,
        "goals": judged,
        "choices": beyond_words.choices(artifacts, measures),
        "facts": beyond_words.facts(artifacts),
        "title": beyond_tables.title,
        "called": beyond_tables.called,
    }
    numbers = {f"{name}.{key}": row[key] for name, row in measures.items() for key in _COMPARED}
    page = Page("beyond", _tables(artifacts, judged), _figures(artifacts), numbers, context)
    publish(page, Path(artifacts.cfg.publish or folder), tracker)


def _tables(
    artifacts: BeyondArtifacts, judged: dict[str, list[beyond_goals.Goal]]
) -> dict[str, pd.DataFrame]:
    """Every table of the page whose part was run, by name."""
    shown = {
        "goals": beyond_goals.table(judged),
        "pools": beyond_tables.pools(artifacts.pools),
        "first": beyond_tables.first(first_times(artifacts)),
        "best_D_optimal": beyond_tables.best(artifacts.best, OPTIMAL),
        "best_greedy": beyond_tables.best(artifacts.best, GREEDY),
    }
    parts = {
        "polish": (artifacts.polish, beyond_tables.polish),
        "objectives": (artifacts.objectives, beyond_tables.objectives),
        "few": (artifacts.few, beyond_tables.few),
        "transfer": (artifacts.transfers, beyond_tables.transfers),
    }
    return shown | {name: make(frame) for name, (frame, make) in parts.items() if len(frame)}


def _figures(artifacts: BeyondArtifacts) -> dict[str, "Figure"]:
    """Every figure of the page whose part was run, by name."""
    pools = artifacts.pools
    seeds = pools[pools.name == SEEDS][list(_SHOWN)].mean()
    compared = metric_panels(_SHOWN, {SEEDS: {key: float(seeds[key]) for key in _SHOWN}})
    plain = metric_panels(_SHOWN)
    polish, few, transfers = artifacts.polish, artifacts.few, artifacts.transfers
    since = Across("seconds", "seconds from nothing", log=True)
    drawn = {"progress": panels(progress(artifacts), since, compared, "variant", run="training")}
    if len(polish):
        cost = Across("milliseconds", "CPU time per valid trajectory [ms]", log=True)
        curve = polish.assign(milliseconds=1000 * polish.seconds)
        drawn["polish"] = panels(curve, cost, plain, "start", markers=True)
    if len(few):
        taught = Across("seeds", "seeds", log=True)
        drawn["few"] = panels(few, taught, plain, "variant", run="training", markers=True)
    for target, part in transfers.groupby("target", sort=False) if len(transfers) else []:
        steps = Across("steps", "steps", log=True)
        drawn[f"transfer-{target}"] = panels(part[part.steps > 0], steps, plain[:2], "way")
    return drawn
