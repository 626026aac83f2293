"""The report on the whole paper: every figure and table beside ours, a verdict for each claim, and why."""

from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd
from torch import Tensor

from experiments import claims, comparisons, exp1, exp2, training
from experiments.artifacts import SEEDS, Artifacts
from experiments.pages import Page, publish
from experiments.words import PAPER
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.stages.long import long_family
from sidegan.pipeline.tracking import Tracker
from sidegan.report import figures, motion, spatial, tables
from sidegan.report.figures import Across, Panel
from sidegan.report.pose import Bundle, Film, Scene, film, scene
from sidegan.report.style import colour

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go
    from matplotlib.figure import Figure

_TRACES = 8  # of generated trajectories, as in the paper's figure 2


collect = Artifacts


def present(artifacts: Artifacts, folder: Path, tracker: Tracker) -> None:
    """Write ``reproduction.md``, ``reproduction.html``, tables, figures and metrics; record the page."""
    numbers, shown = metrics(artifacts), _tables(artifacts)
    judged, pictures = claims.claims(artifacts), _motion(artifacts)
    context = {
        "artifacts": artifacts,
        "cfg": artifacts.cfg,
        "paper": PAPER,
        "reliable": training.RELIABLE,
        "verdicts": claims.counted(judged),
    }
    shown["claims"] = claims.table(judged)
    drawn = _figures(artifacts) | {name: _static(picture) for name, picture in pictures.items()}
    turned = {name: _turned(picture) for name, picture in pictures.items()}
    page = Page("reproduction", shown, drawn, numbers, context, turned)
    publish(page, Path(artifacts.cfg.publish or folder), tracker)


def metrics(artifacts: Artifacts) -> dict[str, float]:
    """The numbers that a later run is compared by."""
    numbers: dict[str, float] = {}
    for name, part in artifacts.generators.groupby("name"):
        for key in ("success", "condition", "distance", "rank", "distance_diagonal"):
            if key in part and part[key].notna().all():
                numbers[f"{name}.{key}"] = float(part[key].mean())
    errors = artifacts.errors.groupby(["set", "weighted"], as_index=False).nmse.mean()
    for name, weighted, value in errors.itertuples(index=False):
        numbers[f"nmse.{name}.{'weighted' if weighted else 'unweighted'}"] = float(value)
    norms = artifacts.whole_facts.groupby("set").covariance_norm.mean()
    return numbers | {f"covariance.{name}": float(value) for name, value in norms.items()}


def _tables(artifacts: Artifacts) -> dict[str, pd.DataFrame]:
    """Every table of the report that has its numbers, by name."""
    raw, whole, changed = artifacts.errors, artifacts.whole_errors, artifacts.sensitivity
    shown = {
        "generators": tables.generators(artifacts.generators),
        "epochs": training.speed(artifacts.histories),
        "table1": exp1.table1(raw, artifacts.plant, ["training", "repeat"]),
        "sets": tables.excitation_sets(raw),
        "long": comparisons.longs(artifacts),
        "table3": exp2.table3(artifacts.whole_facts),
        "whole": exp2.errors(whole),
        "density": comparisons.densities(artifacts.density),
        "timing": comparisons.costs(comparisons.durations(artifacts)),
        "kinds": comparisons.kinds(artifacts.kinds),
        "ablation": comparisons.ablation(artifacts.ablation),
    }
    shown |= {name: table for name, (table, _) in exp2.tables2(whole, artifacts.cfg).items()}
    for end, weighted in {"": False, "_weighted": True}.items():
        if (changed.weighted == weighted).any():
            shown[f"sensitivity{end}"] = comparisons.sensitivity(changed, weighted)
    return shown


def _figures(artifacts: Artifacts) -> dict[str, "Figure"]:
    """Every flat figure of the report, by name."""
    eigen = artifacts.generators[artifacts.generators.name == "eigen"]
    union = {key: float(eigen[f"union_{key}"].mean()) for key in ("distance", "distance_diagonal", "rank")}
    share = [Panel("success", "valid share")]
    nmse = [Panel("nmse", "nMSE, mean over joints", log=True)]
    sizes, taught = comparisons.last_epochs(artifacts.subsets), Across("seeds", "seeds trained on")
    counts = comparisons.counts(artifacts.sensitivity)
    selected = Across("trajectories", "selected trajectories", log=True)
    labels = ("distance to the nearest other seed", "cond(YᵀY)")
    return {
        "training": training.figure(artifacts, union),
        "nmse": figures.errors(artifacts.errors),
        "sizes": figures.panels(sizes, taught, share, "variant", columns=1, markers=True),
        "timing-bars": figures.timing(comparisons.durations(artifacts)),
        "kinds-scatter": figures.quality_diversity(comparisons.kind_points(artifacts.kinds), labels),
        "counts": figures.panels(counts, selected, nmse, "set", columns=1, markers=True),
    }


def _motion(artifacts: Artifacts) -> dict[str, Scene | Film]:
    """What the figures in space show, by name."""
    task, family, first = artifacts.task, artifacts.task.trajectory, artifacts.cfg.trainings[0]
    generated = artifacts.generated("eigen", first).coefficients[:_TRACES]
    traces = [Bundle(f"trajectory {k + 1}", family, c[None]) for k, c in enumerate(generated)]
    longs = zip(artifacts.cfg.long.harmonics, artifacts.longs.items())
    sets = {name: (long_family(task, h), library.coefficients) for h, (name, (_, library)) in longs}
    for name in (SEEDS, "eigen"):
        sets[name] = family, artifacts.selected(name, first).coefficients
    stacked = [
        Bundle(f"{tables.title(name)}\n{_described(*bundle)}", *bundle, colour(name))
        for name, bundle in sets.items()
    ]
    return {
        "traces": scene(task.arm, traces),
        "stacked": scene(task.arm, stacked),
        "snapshots": film(task.arm, family, generated[:1]),
    }


def _described(family: Trajectory, coefficients: Tensor) -> str:
    """Number and duration of a set's trajectories, in words."""
    return f"{family.period:g} s" if len(coefficients) == 1 else f"{len(coefficients)} × {family.period:g} s"


def _static(picture: Scene | Film) -> "Figure":
    return motion.snapshots(picture) if isinstance(picture, Film) else motion.paths(picture)


def _turned(picture: Scene | Film) -> "go.Figure":
    return spatial.snapshots(picture) if isinstance(picture, Film) else spatial.paths(picture)
