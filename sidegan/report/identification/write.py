"""The report of an identification as one HTML file: verdict first, then what it rests on."""

import math
from collections.abc import Iterable, Iterator, Sequence
from html import escape
from pathlib import Path

import pandas as pd

from sidegan.base.storage import write_bytes
from sidegan.report.identification import plots, tables
from sidegan.report.identification.data import Report
from sidegan.report.page import figure_html, page

_NONE_WEAK = (
    "None is so uncertain that it matters for the torques; one near zero may still have a large relative σ."
)
Section = tuple[str, str, str]  # name in links, heading, HTML


def write_report(report: Report, path: Path) -> None:
    """Write the report as one HTML file that needs nothing else, not even a network.

    Args:
        report: what to tell.
        path: where.

    Raises:
        StorageError: when the file cannot be written.
    """
    write_bytes(path, report_html(report).encode())


def report_html(report: Report) -> str:
    """The report as an HTML document."""
    sections = [*_sections(report)]
    links = "".join(f'<a href="#{name}">{escape(heading)}</a>' for name, heading, _ in sections)
    title = f"Identification of {report.title}"
    head = f"<h1>{escape(title)}</h1><nav>{links}</nav>{_verdict(report)}{_facts(report)}"
    body = "\n".join(
        f'<section id="{name}"><h2>{escape(h)}</h2>{content}</section>' for name, h, content in sections
    )
    return page(title, f"{head}\n{body}")


def _verdict(report: Report) -> str:
    reasons = _list(report.reasons) if report.reasons else ""
    return f'<div class="verdict {report.level}"><strong>{escape(report.verdict)}</strong>{reasons}</div>'


def _facts(report: Report) -> str:
    tiles = (
        f'<div class="tile"><span>{escape(k)}</span><b>{escape(v)}</b></div>' for k, v in report.facts.items()
    )
    return f'<div class="tiles">{"".join(tiles)}</div>' if report.facts else ""


def _sections(report: Report) -> Iterator[Section]:
    if report.recommendations:
        yield "next", "What to do next", _list(report.recommendations)
    if report.findings:
        yield "data", "The data", tables.findings(report.findings)
    yield "accuracy", "How well it predicts", _accuracy(report)
    if report.signals:
        yield "torques", "Measured and predicted torque", _torques(report)
        yield "residuals", "What is left over", _residuals(report)
    yield "parameters", "The parameters", _parameters(report)
    if report.covariance is not None or report.condition is not None:
        yield "uncertainty", "What the data can tell", _uncertainty(report)
    if report.friction is not None:
        caption = "Samples are the measured torque less that of the identified rigid body."
        plot = figure_html(plots.friction(report.friction, report.joint_names), "plot-friction", caption)
        yield "friction", "Friction", plot
    if report.links is not None:
        yield "links", "Physically consistent links", _links(report.links)
    if report.files or report.settings or report.command:
        yield "how", "How this was made", _how(report)


def _accuracy(report: Report) -> str:
    words = (
        "nMSE is the mean squared error over the variance of the measured torque: 0 is perfect, 1 is as good "
        "as predicting the mean. RMSE is in N·m (N for sliding joints). What counts is the validation, on "
        "recordings that were held out."
    )
    plot = figure_html(plots.errors(report), "plot-errors")
    pair = f'<div class="pair"><div>{tables.errors(report)}</div><div>{plot}</div></div>'
    return f'<p class="soft">{words}</p>{pair}'


def _torques(report: Report) -> str:
    rest = len(report.signals) - len(plots.shown_recordings(report.signals))
    more = f" {rest} more recordings are not shown." if rest else ""
    caption = f"N·m (N for sliding joints). Choose the recording above the plot; drag to enlarge.{more}"
    return figure_html(plots.torques(report), "plot-torques", caption)


def _residuals(report: Report) -> str:
    spread = "The middle half of the residuals (box), and all but 4 % of them (whiskers)."
    white = (
        "A model that misses nothing leaves residuals that are soon uncorrelated; the low-pass alone "
        "correlates them over about the inverse of its cut-off."
    )
    left = figure_html(plots.residual_spread(report), "plot-spread", spread)
    right = figure_html(plots.residual_correlation(report), "plot-whiteness", white)
    return f'<div class="pair">{left}{right}</div>'


def _parameters(report: Report) -> str:
    weak = [str(name) for name in report.parameters.loc[report.parameters.weak, "name"]]
    words = (
        "Each row is a combination of link parameters that the torques depend on (a base parameter), or one "
        "of a joint. σ is the standard deviation of the estimate."
    )
    told = f"Marked: {len(weak)} whose uncertainty matters for the torques." if weak else _NONE_WEAK
    return f'<p class="soft">{words} {told}</p>{tables.parameters(report)}'


def _uncertainty(report: Report) -> str:
    parts = []
    if report.condition is not None and math.isfinite(report.condition):
        parts.append(
            f"<p>Condition number of the weighted regressor: <b>{tables.number(report.condition, 3)}</b>.</p>"
        )
    if report.covariance is not None:
        names = [str(name) for name in report.parameters.name]
        correlation = tables.correlation_of(report.covariance)
        if pairs := tables.hard_to_tell_apart(correlation, names):
            parts.append(f"<h3>Parameters that are hard to tell apart</h3>{_list(pairs)}")
        caption = "Correlation of the parameters' errors."
        parts.append(figure_html(plots.correlations(correlation, names), "plot-correlation", caption))
    if report.singular_values is not None:
        parts.append(figure_html(plots.spectrum(report.singular_values), "plot-spectrum"))
    return "".join(parts)


def _links(links: pd.DataFrame) -> str:
    words = (
        "One choice of link parameters that some distribution of mass has and that gives the identified "
        "model: mass [kg], centre of mass [m] in the joint's frame, inertia [kg·m²] about it. Single numbers "
        "here are no measurements: only the combinations above are."
    )
    return f'<p class="soft">{words}</p>{tables.links(links)}'


def _how(report: Report) -> str:
    parts = []
    if report.command:
        parts.append(f"<pre>{escape(report.command)}</pre>")
    if report.files:
        rows = [
            (escape(what), f'<a href="{escape(name, quote=True)}"><code>{escape(name)}</code></a>')
            for what, name in report.files.items()
        ]
        parts.append(tables.table(("what", "file"), rows, text=2))
    if report.settings:
        parts.append(
            f"<details><summary>All settings</summary><pre>{escape(report.settings)}</pre></details>"
        )
    return "".join(parts)


def _list(sentences: Sequence[str] | Iterable[str]) -> str:
    return "<ul>" + "".join(f"<li>{escape(one)}</li>" for one in sentences) + "</ul>"
