"""The report of an identification as one HTML file that needs nothing else, not even a network."""

import math

import yaml
from markupsafe import Markup

from sidegan.base.names import plain
from sidegan.identification.identified import IdentifiedArm
from sidegan.report.document import web_page
from sidegan.report.identification import content
from sidegan.report.identification.content import Origin

_RECORDINGS = 12  # that are drawn
_ROUNDING = 1e-12  # below which a number is none, whatever its SI unit


def report_html(identified: IdentifiedArm, origin: Origin) -> bytes:
    """The report as an HTML document."""
    from sidegan.report.canvas import svg  # matplotlib takes a while to import
    from sidegan.report.identification import plots

    return web_page(
        "identification/report.html.jinja",
        {"number": number},
        identified=identified,
        origin=origin,
        title=f"Identification of {identified.model.arm.name}",
        content=content,
        settings=yaml.safe_dump(dict(origin.settings), sort_keys=False, allow_unicode=True),
        drawn=[*identified.validation, *identified.training][:_RECORDINGS],
        plots=plots,
        svg=lambda *drawn: Markup(svg(*drawn)),
    )


def number(value: float, digits: int = 4) -> str:
    """A number for people: ``1.234``, ``1.2e-5``, or a dash where there is none."""
    if not math.isfinite(value):
        return "—"
    return plain(value if abs(value) > _ROUNDING else 0.0, f".{digits}g")
