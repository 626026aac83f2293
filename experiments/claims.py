"""The paper's claims beside what was measured here, each with a verdict that follows from the numbers.

The words of a claim are in ``paper.yaml``; the criterion of each is a method of its name below.
"""

from collections import Counter
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import pandas as pd

from experiments import comparisons, exp2
from experiments.artifacts import Artifacts
from experiments.training import EARLY, RELIABLE
from experiments.words import PAPER
from sidegan.report.style import NOT_MEASURED, number, seconds
from sidegan.report.tables import spread

HOLDS, PART, NOT = "holds", "holds in part", "does not hold"
UNKNOWN = NOT_MEASURED
SIDE_GANS = ("eigen", "diagonal")
_GANS = ("vanilla", *SIDE_GANS)
_SIGNS = {HOLDS: "🟢", PART: "🟡", NOT: "🔴", UNKNOWN: "⚪"}
_PLURAL = {HOLDS: "hold", PART: "hold in part", NOT: "do not hold", UNKNOWN: UNKNOWN}
_STRUGGLES = 0.4  # valid share that vanilla stays below
_COMPARABLE, _MORE = 0.85, 0.1  # of the seeds' mean distance; of what "significantly more" is
_FAILS, _NEARLY = 0.001, 0.1  # valid shares of density estimates that fail completely, or nearly
_FEW = 0.2  # valid share that is "about 10 %"
_ORDERS = 100.0  # times faster that are "orders of magnitude"
_LATE = 40  # epochs after which the paper compares

Values = dict[str, np.ndarray]  # by variant, one for each training


@dataclass(frozen=True)
class Finding:
    """What was measured of one claim: verdict, evidence in words, numbers for the words of the claim."""

    verdict: str
    ours: str
    numbers: dict[str, Any] = field(default_factory=dict)


class Claim(NamedTuple):
    """A claim of the paper, where it makes it and with which figure; and what was found."""

    key: str
    text: str
    where: str
    paper: str
    ours: str
    verdict: str
    why: str


def claims(artifacts: Artifacts) -> list[Claim]:
    """Every claim, in the order of the paper."""
    judged, criteria = [], _Criteria(artifacts)
    for key, words in PAPER["claims"].items():
        finding: Finding = getattr(criteria, key)()
        text, why = (words[part].format(**finding.numbers) for part in ("claim", "why"))
        judged.append(Claim(key, text, words["where"], words["paper"], finding.ours, finding.verdict, why))
    return judged


def table(judged: list[Claim]) -> pd.DataFrame:
    """The claims for people."""
    rows = [
        {
            "Verdict": f"{_SIGNS[claim.verdict]} {claim.verdict}".replace(" ", "\u00a0"),
            "Claim": claim.text,
            "Paper": f"{claim.paper} ({claim.where})",
            "Ours": claim.ours,
            "Why": claim.why,
        }
        for claim in judged
    ]
    return pd.DataFrame(rows).set_index("Verdict")


def counted(judged: Iterable[Claim]) -> str:
    """How many claims hold and how many do not, in words."""
    counts = Counter(claim.verdict for claim in judged)
    parts = {verdict: counts[verdict] for verdict in _SIGNS if counts[verdict]}
    return ", ".join(f"{n} {_PLURAL[verdict] if n > 1 else verdict}" for verdict, n in parts.items())


@dataclass(frozen=True)
class _Criteria:
    """The criterion of each claim, by its name in ``paper.yaml``, and what they share."""

    artifacts: Artifacts

    def reliable(self) -> Finding:
        early = self._at(SIDE_GANS, "success", EARLY)
        ours = f"{_listed(early, _share, '; ')} valid after {EARLY} epochs"
        verdict = _graded(x.mean() >= RELIABLE for x in early.values())
        return Finding(verdict, ours, {"epochs": EARLY, "reliable": RELIABLE})

    def vanilla_fails(self) -> Finding:
        best = _by_training(self.artifacts.histories, "vanilla", "success").max().to_numpy()
        return Finding(HOLDS if best.mean() < _STRUGGLES else NOT, f"at best {_share(best)} valid")

    def fitter(self) -> Finding:
        late = self._late(_GANS, "condition")
        gains = {n: np.median(late["vanilla"]) / np.median(late[n]) for n in SIDE_GANS}
        ours = f"median cond(YᵀY): {_listed(late, _plain, '; ')}; "
        ours += ", ".join(f"{n} {gain:.2g} × better" for n, gain in gains.items())
        return Finding(_graded(gain > 1 for gain in gains.values()), ours)

    def diverse(self) -> Finding:
        seeds, distance = self.artifacts.seeds, self._late(_GANS, "distance")
        rank = self._late(SIDE_GANS, "rank")
        enough = _COMPARABLE * seeds["distance"]
        verdict = _graded(
            distance[n].mean() > distance["vanilla"].mean() and distance[n].mean() > enough for n in SIDE_GANS
        )
        ours = f"mean distance: {_listed(distance)}, seeds {seeds['distance']:.3g}; "
        ours += f"effective rank: {_listed(rank)}, seeds {seeds['rank']:.3g}"
        return Finding(verdict, ours, {"comparable": _COMPARABLE})

    def diverse_diagonals(self) -> Finding:
        return self._against_seeds(self._late(SIDE_GANS, "distance_diagonal"), 1 + _MORE)

    def diverse_union(self) -> Finding:
        diagonals = self.artifacts.generators.set_index("name").union_distance_diagonal
        return self._against_seeds({n: diagonals.loc[[n]].to_numpy(float) for n in SIDE_GANS}, 1.0)

    def _against_seeds(self, diagonals: Values, factor: float) -> Finding:
        """Whether distances of diagonals are so many times those of the seeds."""
        seeds = self.artifacts.seeds["distance_diagonal"]
        verdict = _graded(x.mean() > factor * seeds for x in diagonals.values())
        return Finding(verdict, f"{_listed(diagonals)}, seeds {seeds:.3g}", {"more": _MORE})

    def density_fails(self) -> Finding:
        share = self.artifacts.density.sort_values("bandwidth").success.iloc[-1]
        verdict = HOLDS if share < _FAILS else PART if share < _NEARLY else NOT
        return Finding(verdict, f"{share:.2%} valid at Scott's bandwidth")

    def few_seeds_fail(self) -> Finding:
        smallest = int(self.artifacts.subsets.seeds.min())
        part = self.artifacts.subsets[self.artifacts.subsets.seeds == smallest]
        last = {n: _by_training(part, n, "success").iloc[-1].to_numpy() for n in SIDE_GANS}
        verdict = HOLDS if min(x.mean() for x in last.values()) < _FEW else NOT
        return Finding(verdict, _listed(last, _share, "; "), {"seeds": smallest})

    def short_beat_long(self) -> Finding:
        mean, cfg = self._table1(), self.artifacts.cfg
        seeds = mean.get_group("seeds")
        longs = {f"long-{h}": mean.get_group(f"long-{h}") for h in sorted(cfg.long.harmonics, key=str)}
        ratios = {n: x.mean() / seeds.mean() for n, x in longs.items()}
        parts = [
            f"long with {n.removeprefix('long-')} harmonics {spread(x)} ({ratios[n]:.3g} × the seeds' error)"
            for n, x in longs.items()
        ]
        ours = f"{'; '.join(parts)}; {cfg.selection.count} seeds {spread(seeds)}"
        numbers = {"fewest": min(cfg.long.harmonics), "starts": cfg.long.starts, "period": cfg.long.period}
        numbers |= {"count": cfg.selection.count}
        return Finding(_graded(ratio > 1 for ratio in ratios.values()), ours, numbers)

    def generated_beat_seeds(self) -> Finding:
        mean = self._table1()
        seeds, grown = mean.get_group("seeds"), {n: mean.get_group(n) for n in SIDE_GANS}
        gains = {n: seeds.mean() / x.mean() for n, x in grown.items()}
        ours = "; ".join(f"{n} {spread(x)} ({gains[n]:.2g} ×)" for n, x in grown.items())
        numbers = {"count": self.artifacts.cfg.selection.count}
        return Finding(
            _graded(gain > 1 for gain in gains.values()), f"{ours}; seeds {spread(seeds)}", numbers
        )

    def generated_improve(self) -> Finding:
        gains = self._improvements()
        first = min(self.artifacts.cfg.replication.replicas)
        ours = "; ".join(f"{n} ×{replicas}: {gain:.0f} %" for (n, replicas), gain in gains.items())
        return Finding(_graded(gains[n, first] > 0 for n in _GANS), ours)

    def more_than_vanilla(self) -> Finding:
        gains = self._improvements(min)
        return Finding(_graded(gains[n] > gains["vanilla"] for n in SIDE_GANS), _percent(gains))

    def not_replaced(self) -> Finding:
        gains = self._improvements(max)
        most = {"most": max(self.artifacts.cfg.replication.replicas)}
        return Finding(_graded(gains[n] > 0 for n in _GANS), _percent(gains), most)

    def smallest_norm(self) -> Finding:
        norms = self.artifacts.whole_facts.groupby("set").covariance_norm.mean()
        least = norms[[*_GANS]].idxmin() == "eigen"
        once = norms[f"seeds ×{min(self.artifacts.cfg.replication.replicas)}"]
        ours = "; ".join(f"{n} {x:.3g}" for n, x in norms.items())
        return Finding(HOLDS if least and norms["eigen"] < once else NOT, ours)

    def faster(self) -> Finding:
        ours = comparisons.durations(self.artifacts).ours
        ratio = ours["seed"] / ours["generation"]
        words = f"{seconds(ours['generation'])} against {seconds(ours['seed'])} ({ratio:,.0f} ×)"
        faster = {"seeds_faster": number(PAPER["seconds"]["seed"] / ours["seed"], ",.0f")}
        return _measured(ratio, ratio > _ORDERS, words, faster)

    def checked(self) -> Finding:
        rate = 1 / comparisons.durations(self.artifacts).ours["checked"]
        enough = rate >= 1 / PAPER["seconds"]["checked"]
        return _measured(rate, enough, f"{rate:,.0f} /s")

    def _at(self, names: Iterable[str], key: str, epoch: int) -> Values:
        """A metric after an epoch, or the last one there is."""
        curves = {n: _by_training(self.artifacts.histories, n, key) for n in names}
        return {n: x.iloc[min(epoch, len(x)) - 1].to_numpy() for n, x in curves.items()}

    def _late(self, names: Iterable[str], key: str) -> Values:
        """Mean of a metric over the epochs after ``_LATE``, or of the last one there is."""
        curves = {n: _by_training(self.artifacts.histories, n, key) for n in names}
        return {n: x.iloc[min(_LATE, len(x) - 1) :].mean().to_numpy() for n, x in curves.items()}

    def _table1(self) -> Any:
        """Unweighted nMSE of experiment 1, mean over joints, grouped by set."""
        raw = self.artifacts.errors[~self.artifacts.errors.weighted]
        return raw.groupby(["set", "training", "repeat"]).nmse.mean().groupby("set")

    def _improvements(self, which: Callable[[list[int]], int] | None = None) -> dict[Any, float]:
        """Unweighted improvement [%] by variant and replicas; by variant alone where replicas are chosen."""
        errors, replicas = self.artifacts.whole_errors, self.artifacts.cfg.replication.replicas
        plain = errors[~errors.weighted]
        gains = {
            (n, r): float(exp2.improvement(plain, n, f"seeds ×{r}").improvement.mean())
            for n in _GANS
            for r in replicas
        }
        return gains if which is None else {n: gains[n, which(replicas)] for n in _GANS}


def _by_training(histories: pd.DataFrame, name: str, key: str) -> pd.DataFrame:
    """A metric of one variant by epoch (rows) and training (columns)."""
    return histories[histories.variant == name].pivot(index="epoch", columns="training", values=key)


def _measured(value: float, holds: bool, words: str, numbers: dict[str, Any] | None = None) -> Finding:
    """A finding from a value that may not have been measured."""
    if np.isnan(value):
        return Finding(UNKNOWN, UNKNOWN, numbers or {})
    return Finding(HOLDS if holds else NOT, words, numbers or {})


def _graded(each: Iterable[bool]) -> str:
    every = list(each)
    return HOLDS if all(every) else PART if any(every) else NOT


def _share(x: np.ndarray) -> str:
    return f"{x.mean():.0%} ({x.min():.0%} … {x.max():.0%})"


def _plain(x: np.ndarray) -> str:
    return spread(pd.Series(x))


def _listed(values: Values, words: Callable[[np.ndarray], str] = _plain, between: str = ", ") -> str:
    return between.join(f"{name} {words(x)}" for name, x in values.items())


def _percent(gains: Mapping[str, float]) -> str:
    return "; ".join(f"{name} {gain:.0f} %" for name, gain in gains.items())
