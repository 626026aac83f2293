"""The report of an identification as one HTML file that needs nothing else, not even a network."""

import math
from collections.abc import Sequence

import numpy as np
import yaml
from markupsafe import Markup

from sidegan.base.names import plain
from sidegan.identification.identified import IdentifiedArm
from sidegan.recording.tables import Numbers
from sidegan.report.document import web_page
from sidegan.report.identification import content
from sidegan.report.identification.content import Origin

_RECORDINGS = 12  # that are drawn
_PAIRS = 8  # that are shown
_TOGETHER = 0.8  # correlation from which two parameters are hard to tell apart
_ROUNDING = 1e-12  # below which a number is none, whatever its SI unit


def report_html(identified: IdentifiedArm, origin: Origin) -> bytes:
    """The report as an HTML document."""
    from sidegan.report.canvas import svg  # matplotlib takes a while to import
    from sidegan.report.identification import plots

    chosen = identified.chosen
    return web_page(
        "identification/report.html.jinja",
        {"number": number},
        identified=identified,
        origin=origin,
        title=f"Identification of {identified.model.arm.name}",
        content=content,
        settings=yaml.safe_dump(dict(origin.settings), sort_keys=False, allow_unicode=True),
        drawn=[*identified.validation, *identified.training][:_RECORDINGS],
        pairs=hard_to_tell_apart(chosen.covariance.numpy(), chosen.names),
        plots=plots,
        svg=lambda *drawn: Markup(svg(*drawn)),
    )


def number(value: float, digits: int = 4) -> str:
    """A number for people: ``1.234``, ``1.2e-5``, or a dash where there is none."""
    if not math.isfinite(value):
        return "—"
    return plain(value if abs(value) > _ROUNDING else 0.0, f".{digits}g")


def hard_to_tell_apart(covariance: Numbers, names: Sequence[str]) -> list[str]:
    """Pairs of parameters whose errors go together, a sentence each, the worst first."""
    deviation = np.sqrt(np.diag(covariance))
    scale = np.where(deviation > 0, deviation, 1.0)
    correlation = np.triu(covariance / scale / scale[:, None], 1)
    rows, columns = np.nonzero(np.abs(correlation) >= _TOGETHER)
    worst = np.argsort(-np.abs(correlation[rows, columns]), kind="stable")[:_PAIRS]
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
