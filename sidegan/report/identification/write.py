"""The report of an identification as one HTML file that needs nothing else, not even a network."""

import math
from functools import partial
from pathlib import Path

from jinja2 import Environment, FileSystemLoader, StrictUndefined
from markupsafe import Markup

from sidegan.base.storage import write_bytes
from sidegan.report.identification import plots
from sidegan.report.identification.data import Report
from sidegan.report.identification.numbers import correlation_of, hard_to_tell_apart, number, percent
from sidegan.report.page import figure_html, page

_BAR = 70  # [px] of a relative deviation of 100 %
_ERRORS = {
    "nmse_training": "nMSE, training",
    "nmse_validation": "nMSE, validation",
    "rmse_training": "RMSE, training",
    "rmse_validation": "RMSE, validation",
}


def write_report(report: Report, path: Path) -> None:
    """Write the report as one HTML file.

    Raises:
        StorageError: when the file cannot be written.
    """
    write_bytes(path, report_html(report).encode())


def report_html(report: Report) -> str:
    """The report as an HTML document."""
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
        not_shown=len(report.signals) - len(plots.shown_recordings(report.signals)),
        weak=int(report.parameters.weak.sum()),
        pairs=hard_to_tell_apart(correlation_of(report.covariance), names),
        plot=partial(_plot, report),
    )
    return page(title, body)


def _sections(report: Report) -> dict[str, str]:
    """Headings of the sections that there is something to say in, by name."""
    candidates = {
        "next": ("What to do next", report.recommendations),
        "data": ("The data", report.findings),
        "accuracy": ("How well it predicts", True),
        "torques": ("Measured and predicted torque", report.signals),
        "residuals": ("What is left over", report.signals),
        "parameters": ("The parameters", True),
        "uncertainty": ("What the data can tell", True),
        "friction": ("Friction", report.friction),
        "links": ("Physically consistent links", True),
        "how": ("How this was made", True),
    }
    return {name: heading for name, (heading, content) in candidates.items() if content}


def _plot(report: Report, name: str, caption: str = "") -> Markup:
    """One of the plots as HTML."""
    return Markup(figure_html(plots.PLOTS[name](report), f"plot-{name}", caption))


def _bar(share: float) -> int:
    """Width of a bar [px]."""
    return round(_BAR * min(share, 1.0)) if math.isfinite(share) else _BAR
