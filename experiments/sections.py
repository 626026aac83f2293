"""The sections of the reproduction report, each from the evidence alone."""

from pathlib import Path
from typing import Any

import pandas as pd

from experiments import comparisons, exp1, exp2
from experiments import training as training_experiment
from experiments.artifacts import Evidence
from sidegan.pipeline.plan import LONG, SEEDS
from sidegan.report import figures, interactive, motion, spatial, tables
from sidegan.report.document import Picture, Section, Table, illustrate
from sidegan.report.export import write_table

_TRACES = 8  # of generated trajectories, as in the paper's figure 2
_REPRODUCE = """
## How to make this report

    pip install -c constraints.txt -e '.[dvc]'
    dvc repro

Every stage is resumable: what was computed before an interrupt is not computed again.
"""


def figure3(evidence: Evidence, assets: Path) -> Section:
    """Training against epoch, quality after it, and how soon a variant is reliable."""
    seeds = evidence.seeds
    union = {
        key: float(evidence.union("eigen", key).mean()) for key in ("distance", "distance_diagonal", "rank")
    }
    drawn = (evidence.histories, seeds, union)
    picture = illustrate(
        assets,
        "training",
        figures.training(*drawn),
        "Figure 3: metrics with the true physics after every epoch; lines are means over trainings, bands "
        "their "
        "range, dashed the seeds, golden the union of seeds and the eigen variant's library.",
        interactive.training(*drawn),
    )
    speed = training_experiment.speed(evidence.histories)
    quality = tables.generators(evidence.generators)
    return Section(
        "Figure 3: training",
        [
            picture,
            _table(
                assets, "generators", quality, "Seeds and generators after the last epoch, no sample filtered"
            ),
            _table(assets, "epochs", speed, "How soon a variant is reliable (80 % valid)"),
        ],
    )


def table1(evidence: Evidence, assets: Path) -> Section:
    """Table I with what stands behind it."""
    raw = evidence.errors
    over = ["training", "repeat"]
    known = [evidence.report(evidence.task.long(h)) for h in evidence.task.cfg.long.harmonics]
    longs = pd.DataFrame(known, index=[f"{h} harmonics" for h in evidence.task.cfg.long.harmonics])
    columns = {
        "condition": "cond(YᵀY)",
        "starts": "starts",
        "cpu_seconds": "CPU [s]",
        "allotted_seconds": "CPU of the short ones [s]",
    }
    longs = longs[list(columns)].rename(columns=columns).map(lambda x: f"{x:.4g}")
    return Section(
        "Table I: one long trajectory, seeds, seeds and generated ones",
        [
            _table(
                assets,
                "table1",
                exp1.table1(raw, evidence.plant, over),
                "nMSE of torque prediction, mean over joints ± standard deviation over noise draws and "
                "trainings",
            ),
            illustrate(assets, "nmse", figures.errors(raw), "nMSE by joint", interactive.errors(raw)),
            _table(assets, "sets", tables.excitation_sets(raw), "The sets that were executed"),
            _table(
                assets,
                "long",
                longs.rename_axis("single long trajectory"),
                "How the long trajectories were reached: the same optimiser, at least the CPU time of the "
                "short ones",
            ),
        ],
    )


def table2(evidence: Evidence, assets: Path) -> Section:
    """Tables II and III, unweighted as in the paper and weighted."""
    material = evidence.replication
    blocks: list[Any] = []
    for weighted, name in ((False, "table2"), (True, "table2_weighted")):
        part = material.results[material.results.weighted == weighted]
        if len(part):
            kind = "weighted per joint" if weighted else "unweighted, as in the paper"
            caption = f"Table II: improvement in nMSE, mean ± standard deviation over joints; RLS {kind}"
            blocks.append(_table(assets, name, exp2.table2(part, material.config), caption))
    blocks += [
        _table(assets, "table3", exp2.table3(material.facts), "Table III: ‖diag P‖"),
        _table(assets, "whole", exp2.errors(material.results), "nMSE behind Table II"),
    ]
    return Section("Tables II and III: whole sets, 10 % noise on states and torques", blocks)


def discussion(evidence: Evidence, assets: Path) -> Section:
    """Fewer seeds, and a density estimate in place of the generator."""
    sizes = comparisons.subsets(evidence)
    drawn: dict[str, Any] = {
        "frame": sizes,
        "x": "seeds",
        "y": "success",
        "group": "variant",
        "labels": {"success": "valid share", "seeds": "seeds trained on"},
    }
    return Section(
        "Discussion: fewer seeds, and a density estimate",
        [
            illustrate(
                assets,
                "sizes",
                figures.curve(**drawn),
                "Valid share after the last epoch against the number of seeds",
                interactive.curve(**drawn),
            ),
            _table(
                assets,
                "density",
                comparisons.densities(evidence),
                "Gaussian kernel density estimates of the seeds",
            ),
        ],
    )


def figure2(evidence: Evidence, assets: Path) -> Section:
    """What the trajectories look like."""
    task, first = evidence.task, evidence.task.cfg.trainings[0]
    generated = evidence.library(task.library("eigen", first)).coefficients[:_TRACES]
    stacks = {
        f"{LONG}{h}": (task.long_trajectory(h), evidence.library(task.long(h)).coefficients)
        for h in task.cfg.long.harmonics
    }
    for name in (SEEDS, "eigen"):
        stacks[name] = (task.trajectory, evidence.library(task.selection(name, first)).coefficients)
    physics = (task.arm, task.trajectory)
    pictures: list[Picture] = [
        illustrate(
            assets,
            "traces",
            motion.traces(*physics, generated),
            "End effector along generated trajectories",
            spatial.traces(*physics, generated),
        ),
        illustrate(
            assets,
            "stacked",
            motion.stacked(task.arm, stacks),
            "The single long trajectories beside the short ones of the same total length",
            spatial.stacked(task.arm, stacks),
        ),
        illustrate(
            assets,
            "snapshots",
            motion.snapshots(*physics, generated[:1]),
            "The arm's capsules along one of them",
            spatial.snapshots(*physics, generated[:1]),
        ),
    ]
    return Section("Figure 2: what the trajectories look like", pictures)


def timing(evidence: Evidence, assets: Path) -> Section:
    """The paper's times beside ours."""
    frame = evidence.costs
    machine = evidence.report(evidence.task.timing("eigen", evidence.task.cfg.trainings[0]))
    where = f"{machine['machine']}, {machine['cores']} cores, torch {machine['torch']}"
    drawn = frame[["what", "ours", "paper"]]
    return Section(
        "Timing",
        [
            f"This machine: {where}. Generation and checking on one thread; times of stages are wall times.",
            _table(
                assets, "timing", comparisons.costs(frame), "The paper's figures beside ours, same definition"
            ),
            illustrate(assets, "timing-bars", figures.timing(drawn), "The same", interactive.timing(drawn)),
        ],
    )


def kinds(evidence: Evidence, assets: Path) -> Section:
    """Seeds by the paper's optimiser and for the other fitness."""
    table, points = comparisons.kinds(evidence)
    drawn: dict[str, Any] = {
        "frame": points,
        "quality": "condition",
        "diversity": "nearest",
        "kind": "kind",
        "labels": {"condition": "cond(YᵀY)", "nearest": "distance to the nearest other seed"},
    }
    return Section(
        "Kinds of seeds",
        [
            "The paper's optimiser (ant colony, then compass search) and the gradient optimiser that made "
            "the seed "
            "set, with equally many seeds of each where their diversity is compared.",
            _table(assets, "kinds", table, "Quality, diversity and cost of the seeds"),
            illustrate(
                assets,
                "kinds-scatter",
                figures.quality_diversity(**drawn),
                "Quality against diversity",
                interactive.quality_diversity(**drawn),
            ),
        ],
    )


def sensitivity(evidence: Evidence, assets: Path) -> Section:
    """Table I with other settings."""
    frame = evidence.sensitivity
    counts = frame[(frame.factor == "count") & ~frame.weighted]
    mean = counts.groupby(["set", "training", "repeat", "value"], as_index=False).nmse.mean()
    mean = mean.assign(trajectories=mean.value.astype(int)).sort_values("trajectories")
    drawn: dict[str, Any] = {
        "frame": mean,
        "x": "trajectories",
        "y": "nmse",
        "group": "set",
        "log_x": True,
        "log_y": True,
        "labels": {"nmse": "nMSE, mean over joints", "trajectories": "selected trajectories"},
    }
    return Section(
        "Sensitivity: does the ranking survive?",
        [
            *(
                _table(
                    assets,
                    f"sensitivity{'_weighted' if weighted else ''}",
                    comparisons.sensitivity(frame, weighted),
                    f"nMSE, one setting changed at a time, RLS {'weighted' if weighted else 'unweighted'}",
                )
                for weighted in sorted(frame.weighted.unique())
            ),
            illustrate(
                assets,
                "counts",
                figures.curve(**drawn),
                "nMSE against the number of selected trajectories, unweighted",
                interactive.curve(**drawn),
            ),
        ],
    )


def ablation(evidence: Evidence, assets: Path) -> Section:
    """What each part of the recipe does."""
    return Section(
        "Ablation: which part of the recipe does what",
        [
            "`eigen` is the default recipe; each other row changes one part of it and is trained once. "
            "The last three are the paper's recipe to the letter.",
            _table(
                assets,
                "ablation",
                comparisons.ablation(evidence),
                "After the last epoch, true physics, no sample filtered",
            ),
        ],
    )


def deviations(evidence: Evidence) -> Section:
    """Where this differs from the paper, and how to make the report."""
    task = evidence.task
    return Section(
        "Deviations from the paper",
        [
            f"- **Base parameters**: {task.body.parameters_count} here, 35 in the paper, which does not say "
            "how it "
            "arrives there. The number is the rank of the regressor. More parameters make every condition "
            "number "
            "larger.",
            "- **Noise**: “10 % uniform random noise” is read as multiplicative, on torques in experiment "
            "1 and on "
            "states and torques in experiment 2; the sensitivity table shows other readings.",
            "- **Test set**: random valid trajectories that no compared set contains, with exact torques.",
            "- **The long trajectory** is given in two readings, as many parameters as a short one and the "
            "bandwidth "
            "of the short ones; the paper does not say which it used.",
            "- **Seeds** come from a gradient optimiser on all constraints, torque limits among them; ten "
            "of the "
            "paper's kind are compared above.",
            "- **Surrogates** learn from exactly labelled samples around the seeds and see the trajectory "
            "rolled "
            "out; the ablation shows what the paper's data gives.",
            _REPRODUCE.replace("## How to make this report", "**How to make this report**"),
        ],
    )


def _table(assets: Path, name: str, frame: pd.DataFrame, caption: str) -> Table:
    """A table of the document that is also a file."""
    write_table(frame, assets.with_name("tables") / name, caption)
    return Table(frame, caption)
