"""The report on the whole paper: every figure and table beside ours, a verdict for each claim, and why."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from torch import Tensor

from experiments import claims, comparisons, exp1, exp2, readings, training
from experiments.artifacts import SEEDS, Artifacts, Group, comparison
from experiments.finding import named
from experiments.ladder import changed
from experiments.pages import Page, publish
from experiments.verdicts import CONFIDENCE
from experiments.words import PAPER
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.columns import OURS, configured
from sidegan.pipeline.stages.long import long_family
from sidegan.pipeline.tracking import Tracker
from sidegan.report import figures, motion, spatial, tables
from sidegan.report.figures import Across, Panel
from sidegan.report.pose import Bundle, Film, Scene, film, scene
from sidegan.report.style import colour

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go
    from matplotlib.figure import Figure

_DRAWS = ["column", "training", "repeat"]
_LETTER, _REPAIRED = "letter", "repaired"  # groups of columns
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
        "letter": _paper(groups),
        "repair": _repair(groups),
        "reliable": training.RELIABLE,
        "confidence": CONFIDENCE,
        "left_out": left_out(groups),
        "claims": judged,
        "signed": claims.signed,
        "checked": checked(groups),
        "barren": {name: claims.barren_variants(group) for name, group in groups.items()},
        "recursions": {
            name: readings.distances(group.frame("covariances")) for name, group in groups.items()
        },
        "unchanged": readings.unchanged(),
        "usual": named(artifacts.cfg.identification.prior, artifacts.cfg.identification.forgetting),
        "verdicts": {
            name: claims.counted(claim.findings[name].verdict for claim in judged) for name in groups
        },
    }
    shown = {"claims": claims.table(judged, groups), **_own_tables(groups)}
    drawn = _own_figures(groups) | {name: _static(picture) for name, picture in pictures.items()}
    for name, group in groups.items():
        shown |= {_file(name, key): table for key, table in _tables(group).items()}
        drawn |= {_file(name, key): figure for key, figure in _figures(group).items()}
    turned = {name: _turned(picture) for name, picture in pictures.items()}
    page = Page("reproduction", shown, drawn, metrics(groups), context, turned)
    publish(page, Path(artifacts.cfg.publish or folder), tracker)


def left_out(groups: Groups) -> list[str]:
    """Titles and names of the columns in ``conf/`` that the page is made without."""
    there = {column for group in groups.values() for column in group.parts}
    return [f"{title} ({name})" for name, title in configured().items() if name not in there]


def checked(groups: Groups) -> dict[str, list[str]]:
    """What counts as valid, and the titles of the columns in which it does."""
    words: dict[str, list[str]] = {}
    for group in groups.values():
        words.setdefault(group.first.task.constraints.described(), []).append(group.title)
    return words


def metrics(groups: Groups) -> dict[str, dict[str, float]]:
    """The numbers that a later run is compared by, of the seeds and every variant, mean over trainings."""
    rows = {}
    for group_name, group in groups.items():
        raw, facts = group.frame("errors"), group.frame("whole_facts")
        nmse = raw[~raw.weighted].groupby("set").nmse.mean()
        norms = facts.groupby("set").covariance_norm.mean().rename({"seeds ×1": SEEDS})
        frame = group.frame("generators")
        frame = frame.assign(valid=frame.success.fillna(frame.valid) if "valid" in frame else frame.success)
        for name, part in frame.groupby("name"):
            mean = part[["valid", "condition", "distance", "rank"]].astype(float).mean()
            row = mean.to_dict() | {"nMSE": nmse[name], "‖diag P‖ [1e-9]": 1e9 * norms[name]}
            rows[f"{group_name}-{name}"] = {
                str(k): float(f"{x:.4g}") for k, x in row.items() if np.isfinite(x)
            }
    return rows


def _file(group: str, name: str) -> str:
    """Name of a table's or figure's file; our own have none of a group."""
    return name if group == OURS else f"{group}-{name}"


def _tables(group: Group) -> dict[str, pd.DataFrame]:
    """The tables that every group of columns has, by name."""
    raw, whole, cfg = group.frame("errors"), group.frame("whole_errors"), group.first.cfg
    shown = {
        "generators": tables.generators(group.frame("generators")),
        "epochs": training.speed(group.frame("histories")),
        "table1": exp1.table1(raw, group.frame("plant"), _DRAWS, group.frame("expected")),
        "sets": tables.excitation_sets(raw),
        "long": comparisons.longs(group.first),
        "table3": exp2.table3(group.frame("whole_facts")),
        "whole": exp2.errors(whole),
        "density": comparisons.densities(group.first.density),
    }
    shown |= {name: table for name, (table, _) in exp2.tables2(whole, cfg).items()}
    return shown | readings.shown(group)


def _own_tables(groups: Groups) -> dict[str, pd.DataFrame]:
    """The tables of our own settings alone, by name."""
    artifacts = groups[OURS].first
    changed = artifacts.sensitivity
    shown = {
        "timing": comparisons.costs(comparisons.durations(artifacts, _colony(groups))),
        "kinds": comparisons.kinds(kinds_of(groups)),
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
    measured = pd.DataFrame([part.few_seeds for part in group.parts.values()]).mean()
    seeds = {str(key): float(x) for key, x in measured.items()}
    share = [Panel("success", "valid share")]
    subsets, taught = group.frame("subsets"), Across("seeds", "seeds trained on")
    return {
        "training": training.figure(group.frame("histories"), seeds, union),
        "nmse": figures.errors(raw),
        "sizes": figures.panels(subsets[subsets.kept], taught, share, "variant", columns=1, markers=True),
    }


def _own_figures(groups: Groups) -> dict[str, "Figure"]:
    """The flat figures of our own settings alone, by name."""
    artifacts = groups[OURS].first
    nmse = [Panel("nmse", "nMSE, mean over joints", log=True)]
    counts = comparisons.counts(artifacts.sensitivity)
    selected = Across("trajectories", "selected trajectories", log=True)
    labels = ("distance to the nearest other seed", "cond(YᵀY)")
    return {
        "timing-bars": figures.timing(comparisons.durations(artifacts, _colony(groups))),
        "kinds-scatter": figures.quality_diversity(comparisons.kind_points(kinds_of(groups)), labels),
        "counts": figures.panels(counts, selected, nmse, "set", columns=1, markers=True),
    }


def _paper(groups: Groups) -> Artifacts | None:
    """What was made under the first column whose seeds are by the paper's optimiser."""
    return next((one.first for one in groups.values() if one.first.cfg.seeds.method == "paper"), None)


def _colony(groups: Groups) -> float | None:
    paper = _paper(groups)
    return None if paper is None else paper.seed_seconds


def kinds_of(groups: Groups) -> comparisons.Kinds:
    """Report and library of the seeds and of other kinds of seeds, by our optimiser and by the paper's."""
    kinds, paper = groups[OURS].first.kinds, _paper(groups)
    return kinds if paper is None else kinds | paper.kinds


def _repair(groups: Groups) -> str | None:
    """What the small repair changes of the paper's recipe, None where one of them is not there."""
    if not {_LETTER, _REPAIRED} <= groups.keys():
        return None
    before, after = (groups[name].first.cfg.gan["eigen"] for name in (_LETTER, _REPAIRED))
    return changed(before, after)


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
