"""Tables of an identification, as HTML."""

import math
from collections.abc import Iterable, Sequence
from html import escape

import numpy as np
import pandas as pd

from sidegan.report.identification.data import LINKS, Finding, Numbers, Report

_DIGITS = 4
_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_BAR = 70  # [px] of a relative deviation of 100 %
_HEADS = {
    "nmse_training": "nMSE, training",
    "nmse_validation": "nMSE, validation",
    "rmse_training": "RMSE, training",
    "rmse_validation": "RMSE, validation",
}
_MOST = 10.0  # relative deviation beyond which the number says no more
_PAIRS = 8  # that are shown
_TOGETHER = 0.8  # correlation from which two parameters are hard to tell apart
_ROUNDING = 1e-12  # below which a number is none, whatever its SI unit


def number(value: float, digits: int = _DIGITS) -> str:
    """A number for people: ``1.234``, ``1.2·10⁻⁵``, or a dash where there is none."""
    if not math.isfinite(value):
        return "∞" if value > 0 else "—"
    text = f"{value if abs(value) > _ROUNDING else 0.0:.{digits}g}"
    mantissa, _, exponent = text.partition("e")
    power = f"·10{str(int(exponent)).translate(_POWERS)}" if exponent else ""
    return f"{mantissa}{power}".replace("-", "−")


def table(
    heads: Sequence[str], rows: Iterable[Sequence[str]], text: int = 1, weak: Sequence[bool] = ()
) -> str:
    """An HTML table of cells that are HTML; the first ``text`` columns are words, rows may be marked weak."""
    kinds = [' class="text"' if i < text else "" for i in range(len(heads))]
    head = "".join(f"<th{kind}>{escape(h)}</th>" for kind, h in zip(kinds, heads))
    lines = []
    for i, row in enumerate(rows):
        marked = ' class="weak"' if i < len(weak) and weak[i] else ""
        lines.append(f"<tr{marked}>" + "".join(f"<td{k}>{c}</td>" for k, c in zip(kinds, row)) + "</tr>")
    body = "\n".join(lines)
    return f'<div class="scroll"><table><thead><tr>{head}</tr></thead><tbody>\n{body}\n</tbody></table></div>'


def parameters(report: Report) -> str:
    """A row per parameter with its formula, value, deviation and the URDF's value."""
    frame = report.parameters
    numbers = frame[["value", "std", "relative_std", "urdf"]].astype(float).to_numpy().tolist()
    words = frame[["name", "formula", "unit"]].astype(str).to_numpy().tolist()
    rows = [
        (
            f"<b>{escape(name)}</b>",
            f'<code class="long">{escape(formula)}</code>',
            number(value),
            number(std, 2),
            f"{_bar(share)}{_percent(share)}",
            number(urdf),
            escape(unit),
        )
        for (name, formula, unit), (value, std, share, urdf) in zip(words, numbers)
    ]
    heads = ("parameter", "stands for", "value", "σ", "relative σ", "URDF", "unit")
    return table(heads, rows, text=2, weak=frame.weak.tolist())


def errors(report: Report) -> str:
    """Errors of each joint, and their mean."""
    columns = [c for c in _HEADS if c in report.errors]
    rows = [
        (escape(name), *(number(float(report.errors[c].iloc[j]), 3) for c in columns))
        for j, name in enumerate(report.joint_names)
    ]
    means = (number(float(report.errors[c].mean()), 3) if c.startswith("nmse") else "" for c in columns)
    rows.append(("<b>mean</b>", *(f"<b>{x}</b>" for x in means)))
    return table(["joint", *(_HEADS[c] for c in columns)], rows)


def findings(found: Sequence[Finding]) -> str:
    """What the check of the data found, the worst first."""
    order = ("error", "warning", "ok")
    rows = [
        (
            f'<span class="mark {f.level}">{f.level}</span>',
            escape(f.where),
            f'<span class="long">{escape(f.text)}</span>',
        )
        for f in sorted(found, key=lambda f: order.index(f.level))
    ]
    return table(("", "where", "what"), rows, text=3)


def links(frame: pd.DataFrame) -> str:
    """Consistent inertial parameters of each link about its centre of mass, beside the URDF's masses."""
    columns = [c for c in (*LINKS[1:], "urdf_m") if c in frame]
    values = frame[columns].astype(float).to_numpy().tolist()
    rows = [(escape(str(name)), *map(number, row)) for name, row in zip(frame["link"], values)]
    return table(["link", *("URDF's m" if c == "urdf_m" else c for c in columns)], rows)


def correlation_of(covariance: Numbers) -> Numbers:
    """Correlation (P, P) of a covariance; a parameter without variance is correlated with none."""
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0, deviation, 1.0)
    found = covariance / scale / scale[:, None]
    np.fill_diagonal(found, 1.0)
    return np.clip(found, -1.0, 1.0)


def hard_to_tell_apart(correlation: Numbers, names: Sequence[str]) -> list[str]:
    """Pairs of parameters whose errors go together, a sentence each, the worst first."""
    upper = np.triu(np.abs(correlation), 1)
    rows, columns = np.nonzero(upper >= _TOGETHER)
    worst = np.argsort(-upper[rows, columns], kind="stable")[:_PAIRS]
    told = []
    for i, j in zip(rows[worst], columns[worst]):
        better = "difference" if correlation[i, j] > 0 else "sum"
        told.append(
            f"{names[i]} and {names[j]} ({number(float(correlation[i, j]), 2)}): "
            f"their {better}, each in units of its σ, is known better than either"
        )
    if (rest := len(rows) - len(told)) > 0:
        told.append(f"and {rest} more pairs")
    return told


def _bar(share: float) -> str:
    width = round(_BAR * min(share, 1.0)) if math.isfinite(share) else _BAR
    return f'<span class="bar" style="width:{width}px"></span>'


def _percent(share: float) -> str:
    if not math.isfinite(share):
        return "—"
    if share > _MOST:
        return f"&gt; {100 * _MOST:.0f} %"
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"
