"""A Markdown page as one HTML file: everything inside, readable offline, in the dark and on paper."""

import base64
from collections.abc import Mapping, Sequence
from html import escape
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import unquote

from markdown_it import MarkdownIt
from markdown_it.token import Token

from sidegan.base.storage import write_bytes
from sidegan.errors import ArtifactError
from sidegan.report.page import figure_html, page

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go

_STYLE, _SCRIPT = (Path(__file__).with_name(name) for name in ("document.css", "document.js"))


def write_html(markdown: str, path: Path, interactive: Mapping[str, "go.Figure"] | None = None) -> None:
    """Write Markdown as one HTML page.

    Args:
        markdown: of the page; the links to its figures are relative to ``path``.
        path: the HTML file to write.
        interactive: figures in place of the images of that name; the plotting library comes with them.

    Raises:
        ArtifactError: when the file of a figure is missing.
        StorageError: when the folder cannot be written or is full.
    """
    plots = interactive or {}
    parser = MarkdownIt("commonmark", {"html": False}).enable("table")
    parser.add_render_rule("image", _image(path.parent, plots))
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


def _opens(token: Token, tag: str = "") -> bool:
    return token.type == "heading_open" and token.tag.startswith(tag)


def _mark(tokens: Sequence[Token]) -> None:
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

    def render(renderer: Any, tokens: Sequence[Token], k: int, options: Any, env: Any) -> str:
        link, words = Path(unquote(str(tokens[k].attrGet("src")))), escape(tokens[k].content)
        if link.stem in plots:
            return figure_html(plots[link.stem], link.stem)
        try:
            data = base64.b64encode((folder / link).read_bytes()).decode()
        except FileNotFoundError as error:
            raise ArtifactError(f"there is no figure {folder / link}") from error
        return f'<figure><img src="data:image/png;base64,{data}" alt="{words}"></figure>'

    return render
