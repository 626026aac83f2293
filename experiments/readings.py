"""Tables II and III under other readings of the paper, and Table I's models on other motions."""

import math

import numpy as np
import pandas as pd

from experiments.artifacts import Group
from experiments.claims_identification import OF_WHOLE_SETS, gain
from experiments.finding import named, words
from experiments.verdicts import interval, levels
from experiments.words import PAPER
from sidegan.base.names import plain
from sidegan.pipeline.settings import Config
from sidegan.report import tables

RECURSION = ["prior", "forgetting"]
_FIRST = "seeds ×1"  # that norms are compared with


def improvements(errors: pd.DataFrame, config: Config) -> pd.DataFrame:
    """Improvement [%] over the seeds measured so often, by reading of the noise and variant."""
    rows, replicas = {}, config.replication.replicas
    for reading, part in errors.groupby("reading", sort=False):
        for name in config.gan:
            gains = {k: interval(gain(part, name, k)) for k in replicas}
            rows[str(reading), tables.title(name)] = {f"×{k}": words(x) for k, x in gains.items()}
    for name in config.gan:
        if paper := PAPER["table2"].get(name):
            rows["paper", tables.title(name)] = {f"×{k}": paper.get(k, "—") for k in replicas}
    table = pd.DataFrame.from_dict(rows, orient="index")
    table.index = pd.MultiIndex.from_tuples(table.index)
    table = table.reset_index(names=["noise on", "improvement [%] over seeds"])
    return table.set_index("noise on")


def verdicts(errors: pd.DataFrame, config: Config) -> pd.DataFrame:
    """Verdicts on the claims about Table II by reading of the noise."""
    parts = list(errors.groupby("reading", sort=False))
    rows = {
        PAPER["claims"][key]["claim"]: {str(reading): judge(part, config).verdict for reading, part in parts}
        for key, judge in OF_WHOLE_SETS.items()
    }
    return pd.DataFrame.from_dict(rows, orient="index").rename_axis("claim")


def norm_ratios(norms: pd.DataFrame) -> pd.DataFrame:
    """Covariance norms over that of the seeds measured once, geometric means, by set and recursion."""
    values = norms.assign(log=np.log(norms.covariance_norm)).groupby(["set", *RECURSION], sort=False)
    logs = values.log.mean().unstack("set")
    return logs.sub(logs[_FIRST], axis=0).map(math.exp).T


def recursions(norms: pd.DataFrame) -> pd.DataFrame:
    """Covariance norms over that of the seeds measured once, by set and recursion, with the paper's."""
    ratios = norm_ratios(norms)
    order = tables.ordered(ratios.index)
    shown = ratios.loc[order].map(plain)
    shown.columns = [named(*recursion) for recursion in ratios.columns]
    paper = _paper_ratios().reindex(order)
    shown["paper"] = ["—" if np.isnan(x) else plain(x) for x in paper]
    return shown.rename(index=tables.title).rename_axis("‖diag P‖ over that of seeds ×1")


def distances(norms: pd.DataFrame) -> dict[str, float]:
    """How far each recursion's ratios are from the paper's, as a factor, the nearest first.

    The factor is the geometric mean over the sets of the paper's table beside the seeds measured once.
    """
    ratios, paper = norm_ratios(norms), _paper_ratios().drop(_FIRST)
    apart = ratios.reindex(paper.index).div(paper, axis=0).map(math.log).abs().mean().sort_values()
    return {named(*recursion): math.exp(x) for recursion, x in zip(apart.index.to_list(), apart)}


def unchanged() -> float:
    """The same of norms that are equal for all sets."""
    return math.exp(_paper_ratios().drop(_FIRST).map(math.log).abs().mean())


def elsewhere(errors: pd.DataFrame, weighted: bool) -> pd.DataFrame:
    """Errors of every set's model by kind of test, mean over joints."""
    part = errors[errors.weighted == weighted]
    sets = tables.ordered(part["set"].unique())
    rows = []
    for kind, own in part.groupby("test", sort=False):
        for key, what, scale in (("nmse", "nMSE", 1), ("share", "RMS error [% of torque limit]", 100)):
            means = (scale * own.groupby(["set", *levels(part, "repeat")])[key].mean()).groupby("set")
            cells = {tables.title(name): tables.spread(means.get_group(name)) for name in sets}
            rows.append({"test": kind, "error": what, **cells})
    return pd.DataFrame(rows).set_index("test")


def shown(group: Group) -> dict[str, pd.DataFrame]:
    """All these tables of a group of columns, by name."""
    errors, norms, other = group.frame("readings"), group.frame("covariances"), group.frame("elsewhere")
    found = {
        "readings": improvements(errors, group.first.cfg),
        "reading_verdicts": verdicts(errors, group.first.cfg),
        "recursions": recursions(norms),
    }
    kinds = {"elsewhere": False, "elsewhere_weighted": True}
    return found | {k: elsewhere(other, w) for k, w in kinds.items() if (other.weighted == w).any()}


def _paper_ratios() -> pd.Series:
    norms = pd.Series(PAPER["table3"]).astype(float)
    return norms / norms[_FIRST]
