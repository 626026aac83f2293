"""HTML pages that are one file: style, plots and the plotting library inside, nothing from the network."""

import base64
from collections.abc import Mapping, Sequence
from functools import cache
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from sidegan.base.storage import write_bytes
from sidegan.errors import ArtifactError

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go
    from markdown_it.token import Token

_STYLE, _SCRIPT = (Path(__file__).with_name(name) for name in ("document.css", "document.js"))
_FRAME = Path(__file__).with_name("page.css")
# The browser itself then refuses to load anything, whatever a plotting library may try.
_NOTHING_FROM_OUTSIDE = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; font-src data:"
)
# Signs that only few fonts have, as dots of their colour that every font has.
_DOTS = {"🟢": "#1a7f37", "🟡": "#bf8700", "🔵": "#0969da", "🔴": "#cf222e", "⚪": "#8c959f"}
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


def write_html(markdown: str, path: Path, interactive: Mapping[str, "go.Figure"] | None = None) -> None:
    """Write Markdown, with links to its figures relative to ``path``, as one HTML page.

    Interactive figures take the place of the images of their name, and the plotting library comes with them.

    Raises:
        ArtifactError: when the file of a figure is missing.
    """
    from markdown_it import MarkdownIt

    plots = interactive or {}
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    parser.add_render_rule("image", _image(path.parent, plots))
    parser.add_render_rule("text", lambda _, tokens, k, *__: _dotted(escape(tokens[k].content)))
    parser.add_render_rule("table_open", lambda *_: '<div class="scroll" tabindex="0"><table>')
    parser.add_render_rule("table_close", lambda *_: "</table></div>")
    tokens = parser.parse(markdown)
    _mark(tokens)
    headings = [(x.tag, words.content, x.attrGet("id")) for x, words in pairwise(tokens) if _opens(x)]
    links = [
        f'<li class="{tag}"><a href="#{name}">{escape(words)}</a></li>'
        for tag, words, name in headings
        if tag != "h1"
    ]
    contents = f'<nav class="contents" aria-label="Contents"><ul>{"".join(links)}</ul></nav>' if links else ""
    starts = [0, *(k for k, token in enumerate(tokens) if _opens(token, "h2")), len(tokens)]
    parts = [parser.renderer.render(tokens[a:b], parser.options, {}) for a, b in pairwise(starts)]
    body = [f"<style>{_STYLE.read_text(encoding='utf-8')}</style>", f"<header>{parts[0]}{contents}</header>"]
    body += [f"<section>{part}</section>" for part in parts[1:]]
    body += [f"<script>{_SCRIPT.read_text(encoding='utf-8')}</script>" if plots else ""]
    title = next((words for tag, words, _ in headings if tag == "h1"), path.stem)
    write_bytes(path, page(title, "\n".join(body), bool(plots)).encode())


def _dotted(text: str) -> str:
    for sign, colour in _DOTS.items():
        text = text.replace(sign, f'<span style="color:{colour}">●</span>')
    return text


def _opens(token: "Token", tag: str = "") -> bool:
    return token.type == "heading_open" and token.tag.startswith(tag)


def _mark(tokens: "Sequence[Token]") -> None:
    """Give headings names to link to and captions their class, and free images from their paragraphs."""
    for number, (opening, inline, closing) in enumerate(zip(tokens, tokens[1:], tokens[2:])):
        kinds = [part.type for part in inline.children or []]
        if _opens(opening):
            opening.attrSet("id", f"section-{number}")
        elif opening.type == "paragraph_open" and kinds == ["image"]:
            opening.hidden = closing.hidden = True
        elif opening.type == "paragraph_open" and _is_emphasis(kinds):
            opening.attrSet("class", "caption")


def _is_emphasis(kinds: Sequence[str]) -> bool:
    """Whether a paragraph is one piece in italics."""
    return kinds[:1] == ["em_open"] and kinds.index("em_close") == len(kinds) - 1


def _image(folder: Path, plots: Mapping[str, "go.Figure"]) -> Any:
    """How an image is rendered: as the interactive figure of its name, or with its file inside the page."""

    def render(renderer: Any, tokens: "Sequence[Token]", k: int, options: Any, env: Any) -> str:
        link, words = Path(unquote(str(tokens[k].attrGet("src")))), escape(tokens[k].content)
        if link.stem in plots:
            return figure_html(plots[link.stem], link.stem)
        try:
            data = base64.b64encode((folder / link).read_bytes()).decode()
        except FileNotFoundError as error:
            raise ArtifactError(f"there is no figure {folder / link}") from error
        return f'<figure><img src="data:image/png;base64,{data}" alt="{words}"></figure>'

    return render


def page(title: str, body: str, plots: bool = True) -> str:
    """A whole HTML document of a plain title and a body in HTML; its plots need 5 MB of plotting library."""
    script = f"<script>{_plotly_library()}</script>{_PRINTING}" if plots else ""
    return (
        f'<!DOCTYPE html>\n<html lang="en">\n<head>\n<meta charset="utf-8">\n'
        f'<meta http-equiv="Content-Security-Policy" content="{_NOTHING_FROM_OUTSIDE}">\n'
        f'<meta name="viewport" content="width=device-width, initial-scale=1">\n'
        f"<title>{escape(title)}</title>\n<style>\n{_FRAME.read_text(encoding='utf-8')}</style>\n{script}\n"
        f"</head>\n<body>\n<main>\n{body}\n</main>\n</body>\n</html>\n"
    )


def figure_html(figure: "go.Figure", name: str, caption: str = "") -> str:
    """An interactive plot as wide as the page, with a plain caption; no other on the page has its name."""
    from plotly.io import to_html

    plot = to_html(
        figure,
        config=_TOOLS,
        include_plotlyjs=False,
        full_html=False,
        div_id=name,
        default_height=f"{figure.layout.height or 400}px",
    )
    below = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    return f"<figure>{plot}{below}</figure>"


@cache
def _plotly_library() -> str:
    from plotly.offline import get_plotlyjs

    return get_plotlyjs()
