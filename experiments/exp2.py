"""Experiment 2 (Tables II and III): seeds and generated ones against the seeds measured again and again.

Source: Jegorova et al. 2020, section V-D.
"""

from pathlib import Path

import pandas as pd

from experiments.artifacts import Artifacts
from experiments.pages import leave
from experiments.verdicts import REPEAT, TRAINING
from experiments.words import PAPER
from sidegan.base.names import plain
from sidegan.pipeline.settings import Config
from sidegan.pipeline.tracking import Tracker
from sidegan.report import tables

collect = Artifacts


def present(artifacts: Artifacts, folder: Path, tracker: Tracker) -> None:
    """Print, write and record Tables II and III, unweighted as in the paper and weighted."""
    config, results = artifacts.cfg, artifacts.whole_errors
    noise = config.replication.noise
    setting = f"{noise.level:.0%} uniform noise, {config.replication.repeats} draws, seed {config.seed}"
    spread = "mean ± standard deviation over joints"
    shown = {}
    for name, (table, kind) in tables2(results, config).items():
        shown[name] = table, f"Table II: improvement in nMSE [%], {spread} (RLS {kind}; {setting})"
    shown["table3"] = table3(artifacts.whole_facts), f"Table III: ‖diag P‖ ({setting})"
    shown["errors"] = errors(results), f"nMSE, mean over joints ({setting})"
    leave(folder, tracker, shown, summary(artifacts))


def summary(artifacts: Artifacts) -> pd.DataFrame:
    """Mean errors, improvements over the seeds [%] and norms of every set, for the table of a sweep."""
    errors, facts = artifacts.whole_errors, artifacts.whole_facts
    errors = errors[~errors.weighted]
    columns = {"nMSE": errors.groupby("set", sort=False).nmse.mean()}
    for replicas in artifacts.cfg.replication.replicas:
        gains = {
            k: improvement(errors, k, f"seeds ×{replicas}").improvement.mean() for k in artifacts.cfg.gan
        }
        columns[f"improvement over seeds ×{replicas} [%]"] = pd.Series(gains)
    columns["‖diag P‖"] = facts.groupby("set", sort=False).covariance_norm.mean()
    return pd.DataFrame(columns).reindex(tables.ordered(errors["set"].unique()))


def improvement(part: pd.DataFrame, name: str, reference: str) -> pd.DataFrame:
    """Improvement [%] over a reference set by training, repeat and joint."""
    keys = ["repeat", "joint"]
    base = part[part["set"] == reference][[*keys, "nmse"]]
    both = part[part["set"] == name].merge(base, on=keys, suffixes=("", "_reference"))
    return both.assign(improvement=100 * (1 - both.nmse / both.nmse_reference))


def tables2(results: pd.DataFrame, config: Config) -> dict[str, tuple[pd.DataFrame, str]]:
    """Table II by name, unweighted and weighted as far as there are such results, with its weighting."""
    return {
        "table2_weighted" if weighted else "table2": (table2(part, config), tables.weighting(bool(weighted)))
        for weighted, part in results.groupby("weighted")
    }


def table2(part: pd.DataFrame, config: Config) -> pd.DataFrame:
    """Table II: improvement of seeds + generated over the seeds measured so often, with the paper's."""
    rows: dict[str, dict[str, str]] = {}
    for name in config.gan:
        for replicas in config.replication.replicas:
            gain = improvement(part, name, f"seeds ×{replicas}")
            joints = gain.groupby("joint").improvement.mean()
            trainings = gain.groupby(TRAINING).improvement.mean()
            cells = rows.setdefault(tables.title(name), {})
            cells[f"×{replicas}"] = tables.spread(joints)
            if len(trainings) > 1:
                cells[f"×{replicas}, trainings"] = f"{plain(trainings.min())} … {plain(trainings.max())}"
            cells[f"×{replicas}, paper"] = PAPER["table2"].get(name, {}).get(replicas, "—")
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("improvement [%] over seeds")


def table3(facts: pd.DataFrame) -> pd.DataFrame:
    """Table III: covariance norms, with the paper's."""
    rows = {}
    for name in tables.ordered(facts["set"].unique()):
        part = facts[facts["set"] == name]
        rows[tables.title(name)] = {
            "‖diag P‖": tables.spread(part.groupby(TRAINING).covariance_norm.mean()),
            "‖diag P‖ × samples": plain((part.covariance_norm * part.samples).mean()),
            "paper": PAPER["table3"].get(name, "—"),
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("set")


def errors(results: pd.DataFrame) -> pd.DataFrame:
    """NMSE of every set, mean over joints ± standard deviation over trainings and noise draws."""
    rows: dict[str, dict[str, str]] = {}
    for name in tables.ordered(results["set"].unique()):
        own = results[results["set"] == name]
        mean = {w: p.groupby([TRAINING, REPEAT]).nmse.mean() for w, p in own.groupby("weighted")}
        row = {"weighted" if w else "unweighted": tables.spread(values) for w, values in mean.items()}
        rows[tables.title(name)] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("nMSE")
