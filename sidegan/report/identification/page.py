"""The report of an identification as one HTML file that needs nothing else, not even a network."""

import math
from collections.abc import Sequence
from pathlib import Path

import numpy as np
from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from sidegan.base.storage import write_bytes
from sidegan.report.identification.content import Numbers, Report, correlation_of
from sidegan.report.web import page

_BAR = 70  # [px] of a relative deviation of 100 %
_POWERS = str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹")
_MOST = 10.0  # relative deviation beyond which the number says no more
_PAIRS = 8  # that are shown
_TOGETHER = 0.8  # correlation from which two parameters are hard to tell apart
_ROUNDING = 1e-12  # below which a number is none, whatever its SI unit
_HEADINGS = {
    "next": "What to do next",
    "data": "The data",
    "accuracy": "How well it predicts",
    "torques": "Measured and predicted torque",
    "residuals": "What is left over",
    "parameters": "The parameters",
    "uncertainty": "What the data can tell",
    "friction": "Friction",
    "links": "Physically consistent links",
    "how": "How this was made",
}
_ERRORS = {
    "nmse_training": "nMSE, training",
    "nmse_validation": "nMSE, validation",
    "rmse_training": "RMSE, training",
    "rmse_validation": "RMSE, validation",
}


def write_report(report: Report, path: Path) -> None:
    """Write the report as one HTML file."""
    write_bytes(path, report_html(report).encode())


def report_html(report: Report) -> str:
    """The report as an HTML document."""
    from sidegan.report.canvas import svg  # matplotlib takes a while to import
    from sidegan.report.identification import plots

    environment = Environment(
        loader=FileSystemLoader(Path(__file__).parent),
        autoescape=True,
        trim_blocks=True,
        lstrip_blocks=True,
        undefined=StrictUndefined,
    )
    environment.filters |= {"number": number, "percent": percent, "bar": _bar}
    environment.tests["finite"] = math.isfinite
    names = [str(name) for name in report.parameters.name]
    title = f"Identification of {report.title}"
    body = environment.get_template("report.html.jinja").render(
        report=report,
        title=title,
        sections=_sections(report),
        errors={column: head for column, head in _ERRORS.items() if column in report.errors},
        recordings=plots.shown_recordings(report.signals),
        weak=int(report.parameters.weak.sum()),
        pairs=hard_to_tell_apart(correlation_of(report.covariance), names),
        plots=plots,
        svg=lambda *drawn: Markup(svg(*drawn)),
    )
    return page(title, body)


def _sections(report: Report) -> dict[str, str]:
    """Headings of the sections that there is something to say in, by name."""
    optional = {
        "next": report.recommendations,
        "data": report.findings,
        "torques": report.signals,
        "residuals": report.signals,
        "friction": report.friction,
    }
    return {name: heading for name, heading in _HEADINGS.items() if optional.get(name, True)}


def _bar(share: float) -> int:
    """Width of a bar [px]."""
    return round(_BAR * min(share, 1.0)) if math.isfinite(share) else _BAR


def number(value: float, digits: int = 4) -> str:
    """A number for people: ``1.234``, ``1.2·10⁻⁵``, or a dash where there is none."""
    if not math.isfinite(value):
        return "∞" if value > 0 else "—"
    text = f"{value if abs(value) > _ROUNDING else 0.0:.{digits}g}"
    mantissa, _, exponent = text.partition("e")
    power = f"·10{str(int(exponent)).translate(_POWERS)}" if exponent else ""
    return f"{mantissa}{power}".replace("-", "−")


def percent(share: float) -> str:
    """A share for people: ``12 %``, ``0.8 %``, ``> 1000 %``, or a dash where there is none."""
    if not math.isfinite(share):
        return "—"
    if share > _MOST:
        return f"> {100 * _MOST:.0f} %"
    return f"{100 * share:.0f} %" if share >= 0.1 else f"{100 * share:.2g} %"


def hard_to_tell_apart(correlation: Numbers, names: Sequence[str]) -> list[str]:
    """Pairs of parameters whose errors go together, a sentence each, the worst first."""
    upper = np.triu(np.abs(correlation), 1)
    rows, columns = np.nonzero(upper >= _TOGETHER)
    worst = np.argsort(-upper[rows, columns], kind="stable")[:_PAIRS]
    sentences = []
    for i, j in zip(rows[worst], columns[worst]):
        better = "difference" if correlation[i, j] > 0 else "sum"
        sentences.append(
            f"{names[i]} and {names[j]} ({number(float(correlation[i, j]), 2)}): "
            f"their {better}, each in units of its σ, is known better than either"
        )
    if (rest := len(rows) - len(sentences)) > 0:
        sentences.append(f"and {rest} more pairs")
    return sentences
