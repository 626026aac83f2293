"""Experiment 1 (Table I): one long trajectory / 35 seeds / 35 of seeds and generated ones, of equal length.

Source: Jegorova et al. 2020, section V-C.
"""

from collections.abc import Collection
from pathlib import Path

import numpy as np
import pandas as pd

from experiments import figures, tables, training
from experiments.artifacts import Artifacts
from experiments.pages import PAPER, leave
from experiments.sets import kind_of, sort_sets, title, weighting
from experiments.verdicts import (
    ALONE,
    CONFIDENCE,
    HOLDS,
    NOT,
    REPEAT,
    SIDE_GANS,
    TRAINING,
    Interval,
    above,
    by_set,
    interval,
    log_ratio,
    of_several,
    words,
)
from sidegan.base.names import counted
from sidegan.pipeline.tracking import Tracker
from sidegan.report.tables import spread

SIMULATOR, WEIGHTED = "Simulator", "Simulator, weighted RLS"
EXPECTED, EXPECTED_WEIGHTED = "Simulator, expected", "Simulator, weighted, expected"
CONSTANT = "Simulator, constant noise, weighted, expected"
PLANT, PLANT_WEIGHTED = "MuJoCo plants", "MuJoCo plants, weighted"

NOISES = {
    "error": "noise proportional to the torque, unweighted",
    "error_weighted": "the same, weighted per joint",
    "error_constant": "constant noise, weighted per joint",
}
_DRAWS = "Expected nMSE of sets of {} drawn at random, mean over joints, with the range of 90 % of them"
FACTORS = "Error of the seeds divided by that of each other set, draw by draw and plant by plant"
_NINE_IN_TEN = 0.05, 0.95

collect = Artifacts


def present(artifacts: Artifacts, folder: Path, tracker: Tracker) -> None:
    """Print, write and record Table I, its supporting tables, and its figures."""
    config, raw = artifacts.cfg, artifacts.errors
    trainings = len(config.trainings)
    over = f"mean ± standard deviation over {counted(config.identification.repeats, 'noise draw')}"
    over += f", in rows of plants over {counted(config.plants.count, 'plant')}"
    over += f", and over {trainings} trainings" if trainings > 1 else ""
    caption = f"Table I: nMSE of torque prediction, mean over joints ({over}, seed {config.seed})"
    of_draws = _DRAWS.format(config.selection.count) + finding(artifacts.draws)
    shown = {
        "table1": (table1(raw, artifacts.plant, artifacts.expected, artifacts.constant), caption),
        "draws": (draws(artifacts.draws), of_draws),
        "factors": (
            factors(raw, artifacts.expected, artifacts.plant, config.gan),
            f"{FACTORS} ({CONFIDENCE:.0%} intervals, none for single values). On plants, "
            f"{on_plants(artifacts.plant, config.gan)}",
        ),
        "joints": (tables.joint_table(raw), "nMSE by joint, unweighted RLS"),
        "sets": (tables.excitation_table(raw), "The excitation sets"),
        "generators": (tables.generator_table(artifacts.generators), training.caption(artifacts)),
        "likeness": (tables.likeness_table(artifacts.generators), training.BESIDE),
        "searches": (training.searched(artifacts), training.SEARCHED),
    }
    progress = training.figure(artifacts.histories, artifacts.as_many_seeds)
    drawn = {"training": progress, "nmse": figures.errors(raw), **training.pictures(artifacts)}
    leave(folder, tracker, shown, summary(artifacts), drawn)


def table1(
    raw: pd.DataFrame, plant: pd.DataFrame, expected: pd.DataFrame, constant: pd.DataFrame
) -> pd.DataFrame:
    """Table I with our rows and the paper's; the spread is over trainings and noise draws or plants.

    Expected errors come first (none if states are noisy), then those under constant noise, from noise draws,
    and on plants; some also as geometric means, before the others: one joint can have most of the error.
    """
    rows, parts = {}, dict[str, pd.DataFrame]()
    if len(expected):
        known = expected.weighted.astype(bool)
        parts |= {EXPECTED: expected[~known], EXPECTED_WEIGHTED: expected[known]}
    parts |= {CONSTANT: constant, SIMULATOR: raw[~raw.weighted], WEIGHTED: raw[raw.weighted]}
    parts |= {PLANT: plant[~plant.weighted], PLANT_WEIGHTED: plant[plant.weighted]}
    for label, part in parts.items():
        levels = [key for key in (TRAINING, REPEAT) if key in part]
        if label in (EXPECTED, PLANT, PLANT_WEIGHTED):
            rows[f"{label}, geometric mean"] = _by_set(geometric(part).set_index("set").nmse)
        rows[label] = _by_set(part.groupby(["set", *levels]).nmse.mean())
    columns = sort_sets(raw["set"].unique())
    kinds = {name: kind_of(name)[0].removesuffix("-") for name in columns}
    kinds |= dict.fromkeys(SIDE_GANS, "generated")
    for label, paper in PAPER["table1"].items():
        rows[label] = {name: paper.get(kinds[name], "—") for name in columns}
    table = pd.DataFrame.from_dict(rows, orient="index", columns=columns).fillna("—")
    table.columns = [title(name) for name in columns]
    return table.rename_axis("nMSE")


def _by_set(means: pd.Series) -> dict[str, str]:
    return {str(name): spread(group) for name, group in means.groupby("set")}


def draws(frame: pd.DataFrame) -> pd.DataFrame:
    """Expected nMSE of random draws from each set, by noise: mean, and 5 to 95 % range."""
    rows = {}
    for name, part in frame.groupby("set"):
        low, high = (part.groupby("noise").nmse.quantile(x) for x in _NINE_IN_TEN)
        mean = part.groupby("noise").nmse.mean()
        rows[str(name)] = {
            label: words(Interval(low[key], mean[key], high[key])) for key, label in NOISES.items()
        }
    return pd.DataFrame.from_dict(rows, orient="index").loc[sort_sets(rows)].rename_axis("drawn from")


def finding(frame: pd.DataFrame) -> str:
    """Text on how much weights reduce the gain of the set that is best with weights; empty if they do not."""
    logs = np.log(frame.set_index(["set", "noise"]).geometric).groupby(level=[0, 1]).mean().unstack()
    gains = np.exp(logs.loc["seeds"] - logs.drop("seeds"))[["error", "error_weighted"]].dropna()
    if gains.empty:
        return ""
    plain, weighted = gains.loc[best := gains.error_weighted.idxmax()]
    if weighted >= plain:
        return ""
    left = f"{best}'s gain over the seeds (geometric mean) is {plain:.2f}, and {weighted:.2f} with weights"
    return f"; {left}: if noise is proportional to the torque, more motion means more noise"


def factors(
    raw: pd.DataFrame, expected: pd.DataFrame, plant: pd.DataFrame, trained: Collection[str]
) -> pd.DataFrame:
    """Error of the seeds over that of each other set: above 1 if the other set is better.

    From noise draws, expected, and on plants, each as arithmetic and geometric mean over joints. Intervals
    are over noise draws or plants, and over trainings if there are several.
    """
    rows = {}
    for drawn, frame in ((SIMULATOR, raw), (EXPECTED, expected), (PLANT, plant)):
        for weighted, part in frame.groupby(frame.weighted.astype(bool)):
            name = f"{drawn}, weighted" if weighted else drawn
            for label, errors in ((name, part), (f"{name}, geometric mean", geometric(part))):
                ratios = over_others(errors, trained)
                rows[label] = {
                    title(key): words(interval(x).turned(np.exp)).removesuffix(f" {ALONE}")
                    for key, x in ratios.items()
                }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("seeds over")


def on_plants(plant: pd.DataFrame, trained: Collection[str]) -> str:
    """Text on how many sets with generated trajectories identify plants better or worse than the seeds."""
    sentences = []
    for weighted, part in plant.groupby(plant.weighted.astype(bool)):
        effects = [x for key, x in over_others(part, trained).items() if key in trained]
        verdicts = [above(x) for x in effects]
        larger = sum(interval(x).mean < 0 for x in effects)
        worse = verdicts.count(NOT)
        sentences.append(
            f"{weighting(bool(weighted))}: {larger} of {len(effects)} sets with generated trajectories"
            f" have a larger error than the seeds, {worse} significantly;"
            f" {verdicts.count(HOLDS)} a significantly smaller one"
        )
    begun = [text[0].upper() + text[1:] for text in sentences[1:]]
    return ". ".join([*sentences[:1], *begun])


def over_others(frame: pd.DataFrame, trained: Collection[str]) -> dict[str, pd.Series]:
    """Log ratio of the seeds' nMSE to that of each set of equal size, draw by draw, by set."""
    errors = by_set(frame, "nmse", trained)
    others = [key for key in sort_sets(errors) if kind_of(key)[0] not in ("seeds", "long-")]
    return {key: of_several(log_ratio(errors["seeds"], errors[key])) for key in others}


def geometric(frame: pd.DataFrame) -> pd.DataFrame:
    """Geometric mean of nMSE over joints, in which all joints count equally."""
    levels = [key for key in ("set", TRAINING, REPEAT, "weighted") if key in frame]
    logs = np.log(frame.nmse).groupby([frame[key] for key in levels]).mean()
    return np.exp(logs).reset_index()


def summary(artifacts: Artifacts) -> pd.DataFrame:
    """Mean errors of every set, over joints, trainings and noise draws, for the table of a sweep."""
    raw, plant, expected = artifacts.errors, artifacts.plant, artifacts.expected
    parts = {"nMSE": raw, "nMSE, expected": expected, "nMSE, MuJoCo plants": plant}
    columns = {}
    for name, frame in parts.items():
        for weighted, part in frame.groupby(frame.weighted.astype(bool)):
            columns[f"{name}, weighted" if weighted else name] = part.groupby("set", sort=False).nmse.mean()
    return pd.DataFrame(columns).reindex(sort_sets(raw["set"].unique()))
