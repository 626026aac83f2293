"""The paper's claims, our measurements, and a verdict on each that follows from the numbers.

The text of a claim and its criterion are in ``paper.yaml``; a function in ``claims_training.py`` or
``claims_identification.py`` measures it from the artifacts of a condition.
"""

from collections import Counter
from collections.abc import Iterable, Mapping
from typing import NamedTuple

import pandas as pd

from experiments import claims_identification, claims_training
from experiments.artifacts import Artifacts
from experiments.pages import PAPER
from experiments.verdicts import HOLDS, NOT, OPEN, UNDECIDED, UNKNOWN, Judgement
from sidegan.base.names import counted

_SIGNS = {HOLDS: "🟢", UNDECIDED: "🔵", OPEN: "🔵", NOT: "🔴", UNKNOWN: "⚪"}
_PLURAL = {HOLDS: "hold", NOT: "do not hold"}
CRITERIA = claims_training.CRITERIA | claims_identification.CRITERIA


class Claim(NamedTuple):
    """A claim of the paper: its text, kind, place, number and criterion, and our findings."""

    key: str
    text: str
    kind: str
    where: str
    paper: str
    criterion: str
    why: str
    findings: dict[str, Judgement]  # by condition


def claims(conditions: Mapping[str, Artifacts]) -> list[Claim]:
    """Every claim, in the order of the paper."""
    judged = []
    for key, words in PAPER["claims"].items():
        findings = {name: CRITERIA[key](made) for name, made in conditions.items()}
        numbers: dict[str, object] = {}
        for finding in findings.values():
            numbers = finding.numbers | numbers
        text, criterion, why = (words[part].format(**numbers) for part in ("claim", "criterion", "why"))
        judged.append(
            Claim(key, text, words["kind"], words["where"], words["paper"], criterion, why, findings)
        )
    return judged


def table(judged: list[Claim]) -> pd.DataFrame:
    """The verdicts on every claim, a column for each condition."""
    rows = [
        {"Claim": claim.text, "Kind": claim.kind, "Paper": f"{claim.paper} ({claim.where})"}
        | {name: signed(finding) for name, finding in claim.findings.items()}
        for claim in judged
    ]
    return pd.DataFrame(rows).set_index("Claim")


def findings(judged: list[Claim]) -> pd.DataFrame:
    """Grounds for every verdict: the criterion, and each condition's measurements."""
    rows = [
        {"Claim": claim.text, "Criterion": claim.criterion}
        | {name: f"{signed(finding)}: {finding.ours}" for name, finding in claim.findings.items()}
        | {"Why": claim.why}
        for claim in judged
    ]
    return pd.DataFrame(rows).set_index("Claim")


def confirmed(judged: list[Claim], first: str, other: str) -> str:
    """Text on how many verdicts under a condition another confirms, and which it contradicts."""
    pairs = [(claim.text, claim.findings[first].verdict, claim.findings[other].verdict) for claim in judged]
    found = {verdict: [second for _, x, second in pairs if x == verdict] for verdict in _PLURAL}
    parts = [f"{x.count(verdict)} of the {len(x)} that {_PLURAL[verdict]}" for verdict, x in found.items()]
    against = [text for text, *both in pairs if {*both} == {*_PLURAL}]
    contradicted = f"contradicts: {'; '.join(against)}" if against else "contradicts none"
    return f"of the claims on {first}, {other} confirms {' and '.join(parts)}; it {contradicted}"


def signed(finding: Judgement) -> str:
    """A verdict with its symbol."""
    return f"{_SIGNS[finding.verdict]} {finding.verdict}"


def totals(verdicts: Iterable[str]) -> str:
    """Text with the number of claims for each verdict."""
    counts = Counter(verdicts)
    return ", ".join(counted(counts[v], v, _PLURAL.get(v, v)) for v in _SIGNS if counts[v])
