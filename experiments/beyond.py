"""Exact physics in the loop beside surrogates, plain optimisation and chance: the page ``beyond.md``."""

from pathlib import Path
from typing import TYPE_CHECKING

from experiments import beyond_goals, beyond_tables, beyond_words
from experiments.artifacts import SEEDS
from experiments.artifacts_beyond import BeyondArtifacts
from experiments.pages import Page, publish
from sidegan.pipeline.tracking import Tracker
from sidegan.report.figures import Across, panels
from sidegan.report.figures import metrics as metric_panels

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

_SHOWN = ("success", "condition", "distance", "rank")
_COMPARED = ("success", "condition", "distance", "rank", "stack", "covariance_norm", "nmse", "nmse_weighted")

collect = BeyondArtifacts


def present(artifacts: BeyondArtifacts, folder: Path, tracker: Tracker) -> None:
    """Write ``beyond.md``, its tables, figures and metrics; record the page."""
    measures = beyond_words.summary(artifacts)
    judged = beyond_goals.goals(artifacts)
    context = {
        "artifacts": artifacts,
        "cfg": artifacts.cfg,
        "goals": judged,
        "choices": beyond_words.choices(artifacts, measures),
        "facts": beyond_words.facts(artifacts),
        "good": beyond_tables.GOOD,
        "near": beyond_tables.NEAR - 1,
        "title": beyond_tables.title,
        "called": beyond_tables.called,
    }
    tables = {"goals": beyond_goals.table(judged), **beyond_tables.shown(artifacts)}
    numbers = {name: {key: row[key] for key in _COMPARED} for name, row in measures.items()}
    page = Page("beyond", tables, _figures(artifacts), numbers, context)
    publish(page, Path(artifacts.cfg.publish or folder), tracker)


def _figures(artifacts: BeyondArtifacts) -> dict[str, "Figure"]:
    """Every figure of the page whose part was run, by name."""
    pools = artifacts.pools
    means = pools[pools.name == SEEDS][list(_SHOWN)].mean()
    seeds = {key: float(means[key]) for key in _SHOWN}
    plain = metric_panels(_SHOWN)
    polish, few, transfers = artifacts.polish, artifacts.few, artifacts.transfers
    drawn = {}
    if (progress := artifacts.progress).seconds.notna().any():
        since = Across("seconds", "seconds from nothing", log=True)
        drawn["progress"] = panels(
            progress, since, metric_panels(_SHOWN, {SEEDS: seeds}), "variant", run="training"
        )
    if len(polish) and polish.seconds.notna().any():
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
