"""Experiment 2 (Tables II and III): seeds with generated trajectories against repeated seeds.

Source: Jegorova et al. 2020, section V-D.
"""

from pathlib import Path

import numpy as np
import pandas as pd

from experiments.artifacts import Artifacts
from experiments.pages import PAPER, leave
from experiments.sets import sort_sets, title, weighting
from experiments.verdicts import REPEAT, TRAINING, interval, of_several, words
from sidegan.base.names import counted, plain
from sidegan.pipeline.settings import Config
from sidegan.pipeline.stages.replication import CONTROLS, FITTED
from sidegan.pipeline.tracking import Tracker
from sidegan.report.tables import spread

READINGS = {
    "seeds": "measurements of the seeds",
    "all": "all measurements",
    "torques": "torques",
    "seeds_states": "all torques, and states of the seeds",
}
_CONTROLS = {"random": "random valid", "copies": "the seeds again"}  # beside the generated ones
_FITTED = "‖diag (s Σ + I/p₀)⁻¹‖, p₀ = {:g}, s = {:.3g}".format(*FITTED)
READINGS_CAPTION = "Improvement [%] over repeated measurements of the seeds, by where the paper's noise acts"

collect = Artifacts


def present(artifacts: Artifacts, folder: Path, tracker: Tracker) -> None:
    """Print, write and record Tables II and III, unweighted as in the paper and weighted."""
    config, results = artifacts.cfg, artifacts.whole_errors
    noise = config.replication.noise
    reading = config.replication.readings[0]
    draws = counted(config.replication.repeats, "draw")
    setting = f"{noise.level:.0%} uniform noise on {READINGS[reading]}, {draws}"
    shown = {}
    for name, (table, kind) in tables2(results, config).items():
        shown[name] = table, f"Table II: improvement in nMSE [%] (RLS {kind}; {setting})"
    if len(artifacts.readings) > 1:
        shown["readings"] = readings(artifacts), READINGS_CAPTION
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
            k: improvement(errors, k, f"seeds ×{replicas}").improvement.mean() for k in added(artifacts.cfg)
        }
        columns[f"improvement over seeds ×{replicas} [%]"] = pd.Series(gains)
    columns["‖diag P‖"] = facts.groupby("set", sort=False).covariance_norm.mean()
    return pd.DataFrame(columns).reindex(sort_sets(errors["set"].unique()))


def added(config: Config) -> list[str]:
    """What is added to the seeds: each generator's trajectories, and the controls."""
    return [*config.gan, *CONTROLS]


def _label(name: str) -> str:
    """Label of a set in tables II and III."""
    return f"seeds + {_CONTROLS[name]}" if name in _CONTROLS else title(name)


def improvement(part: pd.DataFrame, name: str, reference: str) -> pd.DataFrame:
    """Improvement [%] over a reference set, and the logarithm of the ratio, by training, repeat and joint."""
    keys = ["repeat", "joint"]
    base = part[part["set"] == reference][[*keys, "nmse"]]
    both = part[part["set"] == name].merge(base, on=keys, suffixes=("", "_reference"))
    ratio = both.nmse / both.nmse_reference
    return both.assign(improvement=100 * (1 - ratio), gain=-np.log(ratio))


def percent(gain: float) -> float:
    """Improvement [%] from the log ratio of the reference's error to the set's."""
    return -100 * float(np.expm1(-gain))


def tables2(results: pd.DataFrame, config: Config) -> dict[str, tuple[pd.DataFrame, str]]:
    """Table II by name, unweighted and weighted if available, with the label of the weighting."""
    return {
        "table2_weighted" if weighted else "table2": (table2(part, config), weighting(bool(weighted)))
        for weighted, part in results.groupby("weighted")
    }


def table2(part: pd.DataFrame, config: Config) -> pd.DataFrame:
    """Table II: improvement of seeds + generated over repeatedly measured seeds, ours and the paper's.

    The paper uses the arithmetic mean of percentages, which a single much worse joint can dominate. The
    geometric mean of ratios has an interval over trainings and noise draws, which both sets share. Random
    valid trajectories and the seeds measured again are controls: what any data improves.
    """
    rows: dict[str, dict[str, str]] = {}
    for name in added(config):
        for replicas in config.replication.replicas:
            gain = improvement(part, name, f"seeds ×{replicas}")
            joints = gain.groupby("joint").improvement.mean()
            effect = gain.groupby([TRAINING, REPEAT]).gain.mean()
            rows[f"{_label(name)} over seeds ×{replicas}"] = {
                "mean over joints": spread(joints),
                "median": plain(joints.median()),
                "geometric mean": words(interval(of_several(effect)).turned(percent)),
                "paper, mean": PAPER["table2"].get(name, {}).get(replicas, "—"),
            }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("improvement [%]")


def readings(made: Artifacts) -> pd.DataFrame:
    """Unweighted improvement [%] of each variant for every reading of the noise, and the paper's."""
    replicas = made.cfg.replication.replicas
    rows: dict[str, dict[str, str]] = {}
    for reading, results in made.readings.items():
        part = results[~results.weighted]
        kinds = rows.setdefault(READINGS[reading], {})
        for name in added(made.cfg):
            gains = [improvement(part, name, f"seeds ×{k}") for k in replicas]
            kinds[name] = "; ".join(plain(x.improvement.mean(), ".0f") for x in gains)
            kinds[f"{name}, geometric"] = "; ".join(plain(percent(x.gain.mean()), ".0f") for x in gains)
    paper = {name: [row.get(k, "—").split(" ")[0] for k in replicas] for name, row in PAPER["table2"].items()}
    rows["Paper"] = {name: "; ".join(row) for name, row in paper.items() if name in made.cfg.gan}
    return pd.DataFrame.from_dict(rows, orient="index").fillna("—").rename_axis("noise on")


def table3(facts: pd.DataFrame) -> pd.DataFrame:
    """Table III: covariance norms, with the paper's."""
    rows = {}
    for name in sort_sets(facts["set"].unique()):
        part = facts[facts["set"] == name]
        rows[_label(name)] = {
            "‖diag P‖": spread(part.groupby(TRAINING).covariance_norm.mean()),
            "‖diag P‖ × samples": plain((part.covariance_norm * part.samples).mean()),
            _FITTED: plain(part.fitted_norm.mean()),
            "paper": PAPER["table3"].get(name, "—"),
        }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("set")


def errors(results: pd.DataFrame) -> pd.DataFrame:
    """NMSE of every set, mean over joints ± standard deviation over trainings and noise draws."""
    rows: dict[str, dict[str, str]] = {}
    for name in sort_sets(results["set"].unique()):
        part = results[results["set"] == name]
        mean = {w: p.groupby([TRAINING, REPEAT]).nmse.mean() for w, p in part.groupby("weighted")}
        row = {"weighted" if w else "unweighted": spread(values) for w, values in mean.items()}
        rows[_label(name)] = row
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("nMSE")
