"""A Markdown page as one HTML file: everything inside, readable offline, in the dark and on paper."""

import base64
from collections.abc import Iterator, Mapping, Sequence
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

_STYLE = Path(__file__).with_name("document.css")
_SCRIPT = Path(__file__).with_name("document.js")


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
    parser.add_render_rule("table_open", _text('<div class="scroll" tabindex="0"><table>'))
    parser.add_render_rule("table_close", _text("</table></div>"))
    tokens = parser.parse(markdown)
    _mark(tokens)
    title = next((text for tag, text, _ in _headings(tokens) if tag == "h1"), path.stem)
    head, *sections = [parser.renderer.render(part, parser.options, {}) for part in _parts(tokens)]
    script = f"<script>{_SCRIPT.read_text(encoding='utf-8')}</script>" if plots else ""
    body = [
        f"<style>{_STYLE.read_text(encoding='utf-8')}</style>",
        f"<header>{head}{_contents(tokens)}</header>",
    ]
    body += [f"<section>{section}</section>" for section in sections]
    write_bytes(path, page(title, "\n".join([*body, script]), bool(plots)).encode())


def _mark(tokens: Sequence[Token]) -> None:
    """Give headings names to link to and captions their class, and free images from their paragraphs."""
    for number, (opening, inline, closing) in enumerate(zip(tokens, tokens[1:], tokens[2:])):
        kinds = [part.type for part in inline.children or []]
        if opening.type == "heading_open":
            opening.attrSet("id", f"section-{number}")
        if opening.type == "paragraph_open" and kinds == ["image"]:
            opening.hidden = closing.hidden = True
        if (
            opening.type == "paragraph_open"
            and kinds[:1] == ["em_open"]
            and kinds.index("em_close") == len(kinds) - 1
        ):
            opening.attrSet("class", "caption")


def _headings(tokens: Sequence[Token]) -> Iterator[tuple[str, str, str]]:
    """Tag, words and name of every heading."""
    for opening, inline in pairwise(tokens):
        if opening.type == "heading_open":
            yield opening.tag, inline.content, str(opening.attrGet("id"))


def _parts(tokens: Sequence[Token]) -> list[list[Token]]:
    """What stands before the first heading of the second level, and every section from there on."""
    parts: list[list[Token]] = [[]]
    for token in tokens:
        if token.type == "heading_open" and token.tag == "h2":
            parts.append([])
        parts[-1].append(token)
    return parts


def _contents(tokens: Sequence[Token]) -> str:
    links = [
        f'<li class="{tag}"><a href="#{name}">{escape(text)}</a></li>'
        for tag, text, name in _headings(tokens)
        if tag != "h1"
    ]
    return f'<nav class="contents" aria-label="Contents"><ul>{"".join(links)}</ul></nav>' if links else ""


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


def _text(html: str) -> Any:
    def render(renderer: Any, tokens: Sequence[Token], k: int, options: Any, env: Any) -> str:
        return html

    return render
