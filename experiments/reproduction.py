"""The report on the whole paper: every figure and table beside ours, a verdict for each claim, and why."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd
from torch import Tensor

from experiments import claims, comparisons, exp1, exp2, readings, training
from experiments.artifacts import SEEDS, Artifacts, Group, comparison
from experiments.pages import Page, publish
from experiments.verdicts import CONFIDENCE
from experiments.words import PAPER
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.columns import OURS
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


Groups = Mapping[str, Group]

collect = comparison


def present(groups: Groups, folder: Path, tracker: Tracker) -> None:
    """Write ``reproduction.md``, ``reproduction.html``, tables, figures and metrics; record the page."""
    artifacts = groups[OURS].first
    judged, pictures = claims.claims(groups), _motion(artifacts)
    context = {
        "groups": groups,
        "artifacts": artifacts,
        "cfg": artifacts.cfg,
        "paper": PAPER,
        "reliable": training.RELIABLE,
        "confidence": CONFIDENCE,
        "claims": judged,
        "signed": claims.signed,
        "recursions": {
            name: readings.distances(group.frame("covariances")) for name, group in groups.items()
        },
        "unchanged": readings.unchanged(),
        "usual": readings.named(artifacts.cfg.identification.prior, artifacts.cfg.identification.forgetting),
        "verdicts": {
            group.title: claims.counted(claim.findings[name].verdict for claim in judged)
            for name, group in groups.items()
        },
    }
    shown = {"claims": claims.table(judged, groups), **_own_tables(artifacts)}
    drawn = _own_figures(artifacts) | {name: _static(picture) for name, picture in pictures.items()}
    for name, group in groups.items():
        shown |= {_file(name, key): table for key, table in _tables(group).items()}
        drawn |= {_file(name, key): figure for key, figure in _figures(group).items()}
    turned = {name: _turned(picture) for name, picture in pictures.items()}
    page = Page("reproduction", shown, drawn, metrics(groups), context, turned)
    publish(page, Path(artifacts.cfg.publish or folder), tracker)


def metrics(groups: Groups) -> dict[str, float]:
    """The numbers that a later run is compared by: of every generator and table, mean over trainings."""
    numbers: dict[str, float] = {}
    for name, group in groups.items():
        generators = group.frame("generators").groupby("name")
        for key in ("success", "condition", "distance", "rank"):
            numbers |= _named(name, generators[key].mean().dropna(), key)
        raw, facts = group.frame("errors"), group.frame("whole_facts")
        numbers |= _named(name, raw[~raw.weighted].groupby("set").nmse.mean(), "nmse")
        numbers |= _named(name, facts.groupby("set").covariance_norm.mean(), "covariance")
    return numbers


def _named(group: str, values: pd.Series, key: str) -> dict[str, float]:
    return {f"{group}.{key}.{name}": float(f"{value:.4g}") for name, value in values.items()}


def _file(group: str, name: str) -> str:
    """Name of a table's or figure's file; our own have none of a group."""
    return name if group == OURS else f"{group}-{name}"


def _tables(group: Group) -> dict[str, pd.DataFrame]:
    """The tables that every group of columns has, by name."""
    raw, whole, cfg = group.frame("errors"), group.frame("whole_errors"), group.first.cfg
    shown = {
        "generators": tables.generators(group.frame("generators")),
        "epochs": training.speed(group.frame("histories")),
        "table1": exp1.table1(raw, group.frame("plant"), ["column", "training", "repeat"]),
        "sets": tables.excitation_sets(raw),
        "table3": exp2.table3(group.frame("whole_facts")),
        "whole": exp2.errors(whole),
        "density": comparisons.densities(group.first.density),
    }
    shown |= {name: table for name, (table, _) in exp2.tables2(whole, cfg).items()}
    return shown | readings.shown(group)


def _own_tables(artifacts: Artifacts) -> dict[str, pd.DataFrame]:
    """The tables of our own settings alone, by name."""
    changed = artifacts.sensitivity
    shown = {
        "long": comparisons.longs(artifacts),
        "timing": comparisons.costs(comparisons.durations(artifacts)),
        "kinds": comparisons.kinds(artifacts.kinds),
        "ablation": comparisons.ablation(artifacts.ablation),
    }
    for end, weighted in {"": False, "_weighted": True}.items():
        if (changed.weighted == weighted).any():
            shown[f"sensitivity{end}"] = comparisons.sensitivity(changed, weighted)
    return shown


def _figures(group: Group) -> dict[str, "Figure"]:
    """The flat figures that every group of columns has, by name."""
    generators, raw = group.frame("generators"), group.frame("errors")
    eigen = generators[generators.name == "eigen"]
    union = {key: float(eigen[f"union_{key}"].mean()) for key in ("distance", "distance_diagonal", "rank")}
    share = [Panel("success", "valid share")]
    sizes, taught = comparisons.last_epochs(group.frame("subsets")), Across("seeds", "seeds trained on")
    return {
        "training": training.figure(group.frame("histories"), generators, union),
        "nmse": figures.errors(raw),
        "sizes": figures.panels(sizes, taught, share, "variant", columns=1, markers=True),
    }


def _own_figures(artifacts: Artifacts) -> dict[str, "Figure"]:
    """The flat figures of our own settings alone, by name."""
    nmse = [Panel("nmse", "nMSE, mean over joints", log=True)]
    counts = comparisons.counts(artifacts.sensitivity)
    selected = Across("trajectories", "selected trajectories", log=True)
    labels = ("distance to the nearest other seed", "cond(YᵀY)")
    return {
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
