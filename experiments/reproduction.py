"""The report on the whole paper: every figure and table beside ours, a verdict for each claim, and why."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
import pandas as pd
from torch import Tensor

from experiments import claims, comparisons, exp1, exp2, training
from experiments.artifacts import SEEDS, Artifacts, Group, comparison
from experiments.pages import Page, publish
from experiments.verdicts import CONFIDENCE
from experiments.words import PAPER
from sidegan.motion.trajectory import Trajectory
from sidegan.pipeline.stages.baselines import long_family
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report import figures, motion, tables
from sidegan.report.figures import Panel
from sidegan.report.motion import Bundle
from sidegan.report.style import colour

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

_DRAWS = ["seed_set", "training", "repeat"]
_TRACES = 8  # of generated trajectories, as in the paper's figure 2

# Tables of all groups together, with the rows of them that are on the page; all where none are named.
_JOINED: dict[str, tuple[str, ...]] = {
    "generators": (),
    "table1": (exp1.SIMULATOR, exp1.EXPECTED, exp1.PLANT),
    "factors": (exp1.SIMULATOR, exp1.EXPECTED),
    "table2": (),
    "table3": (),
}

_SEEDS = {
    "published": "of the authors",
    "paper": "by the paper's optimisers",
    "gradient": "by gradients, the better optimiser",
}

Groups = Mapping[str, Group]

collect = comparison


def check(task: Task) -> None:
    """Refuse conditions that are not there, before any work."""
    comparison(task)


def present(groups: Groups, folder: Path, tracker: Tracker) -> None:
    """Write ``reproduction.md``, its tables, figures and metrics; record the page."""
    artifacts = next(iter(groups.values())).first
    judged = claims.claims(groups)
    context = {
        "groups": groups,
        "artifacts": artifacts,
        "cfg": artifacts.cfg,
        "paper": PAPER,
        "reliable": training.RELIABLE,
        "confidence": CONFIDENCE,
        "claims": judged,
        "signed": claims.signed,
        "described": {name: described(group.first) for name, group in groups.items()},
        "checked": checked(groups),
        "barren": {name: claims.barren_variants(group) for name, group in groups.items()},
        "verdicts": {
            name: claims.counted(claim.findings[name].verdict for claim in judged) for name in groups
        },
    }
    firsts = {name: group.first for name, group in groups.items()}
    of_seeds: dict[str, str] = {}  # the first condition of each seed set
    for name, one in firsts.items():
        of_seeds.setdefault(seed_set(one.task).digest, name)
    shown = {
        "claims": claims.table(judged),
        "findings": claims.findings(judged),
        "seeds": comparisons.seed_sets(firsts),
    }
    of_groups = {name: _tables(group) for name, group in groups.items()}
    shown |= {key: _joined(key, of_groups) for key in _JOINED}
    shown["density"] = _joined("density", {name: of_groups[name] for name in of_seeds.values()})
    drawn: dict[str, Figure] = {}
    for name, group in groups.items():
        shown |= {f"{name}-{key}": table for key, table in of_groups[name].items()}
        drawn |= {f"{name}-{key}": figure for key, figure in _figures(group).items()}
    page = Page("reproduction", shown, drawn, metrics(groups), context)
    publish(page, Path(artifacts.cfg.publish or folder), tracker)


def described(artifacts: Artifacts) -> str:
    """The seeds and the recipe of a condition, in a sentence."""
    seeds = _SEEDS.get(artifacts.cfg.seeds.method, artifacts.cfg.seeds.method)
    published = any(variant.published is not None for variant in artifacts.cfg.gan.values())
    return f"{artifacts.seeds['count']:.0f} seeds {seeds}, {'their' if published else 'our'} recipe."


def checked(groups: Groups) -> dict[str, list[str]]:
    """Definitions of valid, each with the groups that use it."""
    words: dict[str, list[str]] = {}
    for name, group in groups.items():
        words.setdefault(group.first.task.constraints.described(), []).append(name)
    return words


def metrics(groups: Groups) -> dict[str, dict[str, float]]:
    """The numbers that a later run is compared by, of the seeds and every variant, mean over trainings."""
    rows = {}
    for group_name, group in groups.items():
        raw, facts = group.frame("errors"), group.frame("whole_facts")
        nmse = raw[~raw.weighted].groupby("set").nmse.mean()
        norms = facts.groupby("set").covariance_norm.mean().rename({"seeds ×1": SEEDS})
        for name, mean in training.means(group.frame("generators")).to_dict("index").items():
            row = mean | {"nMSE": nmse[str(name)], "‖diag P‖ [1e-9]": 1e9 * norms[str(name)]}
            rows[f"{group_name}-{name}"] = {
                str(k): float(f"{x:.4g}") for k, x in row.items() if np.isfinite(x)
            }
    return rows


def _joined(key: str, of_groups: Mapping[str, Mapping[str, pd.DataFrame]]) -> pd.DataFrame:
    """One table of all groups, with the rows that ``_JOINED`` names, and the paper's own once at the end."""
    parts, kept = {name: shown[key] for name, shown in of_groups.items()}, _JOINED.get(key)
    wanted = {name: part[part.index.isin(kept)] if kept else part for name, part in parts.items()}
    joined = pd.concat(wanted, names=["condition"])
    first = next(iter(parts.values()))
    paper = first[first.index.astype(str).str.startswith("Paper")]
    index = pd.MultiIndex.from_product([["paper"], paper.index], names=joined.index.names)
    return pd.concat([joined, paper.set_axis(index)]).fillna("—")


def _tables(group: Group) -> dict[str, pd.DataFrame]:
    """The tables of a group of conditions, by name."""
    raw, whole, cfg = group.frame("errors"), group.frame("whole_errors"), group.first.cfg
    shown = {
        "generators": tables.generators(group.frame("generators")),
        "epochs": training.speed(group.frame("histories")),
        "table1": exp1.table1(raw, group.frame("plant"), _DRAWS, group.frame("expected")),
        "factors": exp1.factors(raw, group.frame("expected"), cfg.gan),
        "sets": tables.excitation_sets(raw),
        "long": comparisons.longs(group.first),
        "table3": exp2.table3(group.frame("whole_facts")),
        "whole": exp2.errors(whole),
        "density": comparisons.densities(group.first.density),
        "timing": comparisons.costs(comparisons.durations(group.first)),
    }
    return shown | {name: table for name, (table, _) in exp2.tables2(whole, cfg).items()}


def _figures(group: Group) -> dict[str, "Figure"]:
    """The figures of a group of conditions, by name."""
    generators, raw = group.frame("generators"), group.frame("errors")
    eigen = generators[generators.name == "eigen"]
    union = {key: float(eigen[f"union_{key}"].mean()) for key in ("distance", "distance_diagonal", "rank")}
    measured = pd.DataFrame([part.few_seeds for part in group.parts.values()]).mean()
    seeds = {str(key): float(x) for key, x in measured.items()}
    share = [Panel("success", "valid share")]
    subsets, taught = group.frame("subsets"), ("seeds", "seeds trained on")
    return {
        "training": training.figure(group.frame("histories"), seeds, union),
        "nmse": figures.errors(raw),
        "sizes": figures.panels(subsets[subsets.kept], taught, share, "variant", columns=1, markers=True),
        **_motion(group.first),
    }


def _motion(artifacts: Artifacts) -> dict[str, "Figure"]:
    """The figures in space, by name."""
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
        "traces": motion.paths(task.arm, traces),
        "stacked": motion.paths(task.arm, stacked),
        "snapshots": motion.snapshots(task.arm, family, generated[:1]),
    }


def _described(family: Trajectory, coefficients: Tensor) -> str:
    """Number and duration of a set's trajectories, in words."""
    duration = f"{family.period:.4g} s"
    return duration if len(coefficients) == 1 else f"{len(coefficients)} × {duration}"
