"""HTML pages that are one file: style, plots and the plotting library inside, nothing from the network."""

import html
from functools import cache
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import plotly.graph_objects as go

_STYLE = Path(__file__).with_name("page.css")
# The browser itself then refuses to load anything, whatever a plotting library may try.
_NOTHING_FROM_OUTSIDE = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)
_TOOLS = {
    "responsive": True,
    "displaylogo": False,
    "displayModeBar": "hover",
    "modeBarButtonsToRemove": ["select2d", "lasso2d", "autoScale2d"],
}
# Plots have the width of the screen that they were drawn for: on paper they take that of the page.
_PRINTING = """<script>
const plots = () => document.querySelectorAll(".plotly-graph-div");
addEventListener("beforeprint", () => plots().forEach(
  plot => Plotly.relayout(plot, {width: plot.closest(".pair") ? 520 : 1050})));
addEventListener("afterprint", () => plots().forEach(plot => Plotly.relayout(plot, {autosize: true})));
</script>"""


def page(title: str, body: str, plots: bool = True) -> str:
    """A whole HTML document.

    Args:
        title: plain text.
        body: HTML.
        plots: whether the body has any; they need 5 MB of plotting library.
    """
    script = f"<script>{_plotly_library()}</script>{_PRINTING}" if plots else ""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_NOTHING_FROM_OUTSIDE}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{html.escape(title)}</title>\n<style>\n{_STYLE.read_text(encoding='utf-8')}</style>\n{script}\n"
        f"</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def figure_html(figure: "go.Figure", name: str, caption: str = "") -> str:
    """An interactive plot with a caption (plain text).

    Args:
        figure: what to plot; its height is kept, its width is the page's.
        name: of the element, a word that no other on the page has.
        caption: below it.
    """
    from plotly.io import to_html

    plot = to_html(
        figure,
        config=_TOOLS,
        include_plotlyjs=False,
        full_html=False,
        div_id=name,
        default_height=f"{figure.layout.height or 400}px",
    )
    below = f"<figcaption>{html.escape(caption)}</figcaption>" if caption else ""
    return f"<figure>{plot}{below}</figure>"


@cache
def _plotly_library() -> str:
    from plotly.offline import get_plotlyjs

    return get_plotlyjs()
