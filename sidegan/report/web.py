"""A document as one HTML page: everything inside, readable offline, in the dark and on paper."""

import base64
import re
from collections.abc import Iterator
from html import escape
from itertools import count
from pathlib import Path

from markdown_it import MarkdownIt

from sidegan.base.storage import write_bytes
from sidegan.errors import ArtifactError
from sidegan.report.document import Block, Claims, Document, Picture, Section, Table, Text, verdicts
from sidegan.report.page import figure_html, page

_STYLE = Path(__file__).with_name("document.css")
_SCRIPT = Path(__file__).with_name("document.js")
_NUMBER = re.compile(r"[\d\s.,:;±+−–—%×eE()/<>≤≥-]*")  # cells of such signs alone line up on the right


def write_html(document: Document, path: Path) -> None:
    """Write the document as one HTML page; the plotting library is in it when there is an interactive figure.

    Raises:
        ArtifactError: when the file of a figure is missing.
        StorageError: when the folder cannot be written or is full.
    """
    plots = any(_interactive(block) for section in document.sections for block in section.blocks)
    script = f"<script>{_SCRIPT.read_text(encoding='utf-8')}</script>" if plots else ""
    head = f"<header><h1>{escape(document.title)}</h1>{_words(document.lead)}{_contents(document)}</header>"
    style = f"<style>{_STYLE.read_text(encoding='utf-8')}</style>"
    body = "\n".join([style, head, *_sections(document), script])
    write_bytes(path, page(document.title, body, plots).encode())


def _interactive(block: Block) -> bool:
    return isinstance(block, Picture) and block.interactive is not None


def _contents(document: Document) -> str:
    links = [
        f'<li class="level{section.level}"><a href="#{_anchor(k)}">{escape(section.title)}</a></li>'
        for k, section in enumerate(document.sections)
    ]
    return f'<nav class="contents" aria-label="Contents"><ul>{"".join(links)}</ul></nav>' if links else ""


def _anchor(k: int) -> str:
    return f"section-{k + 1}"


def _sections(document: Document) -> Iterator[str]:
    """Sections, each with its parts."""
    names = (f"figure-{k}" for k in count(1))
    groups: list[list[str]] = []
    for k, section in enumerate(document.sections):
        if section.level == 2 or not groups:
            groups.append([])
        groups[-1].append(_section(section, _anchor(k), names))
    for parts in groups:
        yield f"<section>{''.join(parts)}</section>"


def _section(section: Section, anchor: str, names: Iterator[str]) -> str:
    heading = f'<h{section.level} id="{anchor}">{escape(section.title)}</h{section.level}>'
    return heading + "\n".join(_block(block, names) for block in section.blocks)


def _block(block: Block, names: Iterator[str]) -> str:
    match block:
        case Text():
            return _words(block.markdown)
        case Table():
            return _table(block)
        case Picture():
            return _picture(block, next(names))
        case Claims():
            return _claims(block)
        case _:
            return _words(block)


def _words(markdown: str) -> str:
    """HTML of Markdown; HTML in it is shown as it is."""
    return f'<div class="words">{_renderer().render(markdown)}</div>'


def _renderer() -> MarkdownIt:
    return MarkdownIt("commonmark", {"html": False}).enable("table")


def _table(table: Table) -> str:
    flat = table.flat
    numbers = [k > 0 and all(map(_NUMBER.fullmatch, flat.iloc[:, k])) for k in range(flat.shape[1])]
    kinds = ["" if number else ' class="text"' for number in numbers]
    head = "".join(f"<th{kind}>{escape(str(name))}</th>" for kind, name in zip(kinds, flat.columns))
    rows = [
        "".join(f"<td{kind}>{escape(cell)}</td>" for kind, cell in zip(kinds, row))
        for row in flat.to_numpy().tolist()
    ]
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    return _framed(f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>", table.caption)


def _framed(content: str, caption: str, kind: str = "") -> str:
    below = f"<figcaption>{escape(caption)}</figcaption>" if caption else ""
    frame = f'<div class="scroll" tabindex="0"><table>{content}</table></div>'
    return f'<figure class="table {kind}">{below}{frame}</figure>'


def _picture(picture: Picture, name: str) -> str:
    if picture.interactive is not None:
        return figure_html(picture.interactive, name, picture.caption)
    try:
        data = base64.b64encode(picture.path.read_bytes()).decode()
    except FileNotFoundError as error:
        raise ArtifactError(f"there is no figure {picture.path}") from error
    caption = escape(picture.caption)
    image = f'<img src="data:image/png;base64,{data}" alt="{caption}">'
    return f"<figure>{image}<figcaption>{caption}</figcaption></figure>"


def _claims(claims: Claims) -> str:
    """Verdicts as badges, counted above; on a narrow screen a card per claim."""
    summary = "".join(
        f"<li>{_badge(verdict, f'{number} {words}')}</li>"
        for (verdict, number), words in zip(claims.counts.items(), _each(claims))
    )
    names = ("Verdict", "Claim", "Paper", "Ours", "Why")
    head = "".join(f'<th class="text">{name}</th>' for name in names)
    rows = []
    for claim in claims.claims:
        words = (claim.text, claim.paper, claim.ours, claim.why)
        cells = [_badge(claim.verdict, claim.verdict), *(_renderer().renderInline(text) for text in words)]
        rows.append(
            "".join(f'<td class="text" data-name="{name}">{cell}</td>' for name, cell in zip(names, cells))
        )
    body = "".join(f"<tr>{row}</tr>" for row in rows)
    table = _framed(f"<thead><tr>{head}</tr></thead><tbody>{body}</tbody>", claims.caption, "claims")
    return f'<ul class="summary">{summary}</ul>{table}'


def _each(claims: Claims) -> list[str]:
    return [part.split(" ", 1)[1] for part in verdicts(claims.counts).split(", ")]


def _badge(verdict: str, words: str) -> str:
    return f'<span class="badge {verdict.replace(" ", "-")}">{escape(words)}</span>'
