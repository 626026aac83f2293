"""A document as GitHub-flavoured Markdown."""

import os
from pathlib import Path
from urllib.parse import quote

import pandas as pd

from sidegan.base.storage import write_bytes
from sidegan.report.document import Block, Claims, Document, Picture, Table, Text, verdicts
from sidegan.report.export import markdown

_SIGNS = {"holds": "🟢", "holds in part": "🟡", "does not hold": "🔴", "not tested": "⚪"}


def write_markdown(document: Document, path: Path) -> None:
    """Write the document as Markdown, with links to the figures relative to it.

    Raises:
        StorageError: when the folder cannot be written or is full.
    """
    parts = [f"# {document.title}", document.lead]
    for section in document.sections:
        parts.append(f"{'#' * section.level} {section.title}")
        parts += [_block(block, path.parent) for block in section.blocks]
    write_bytes(path, ("\n\n".join(part.strip() for part in parts if part.strip()) + "\n").encode())


def _block(block: Block, folder: Path) -> str:
    match block:
        case Text():
            return block.markdown
        case Table():
            return f"{_caption(block.caption)}\n\n{markdown(block.flat)}"
        case Picture():
            link = quote(Path(os.path.relpath(block.path.resolve(), folder.resolve())).as_posix())
            words = block.caption.replace("[", "(").replace("]", ")")
            return f"![{words}]({link})\n\n{_caption(block.caption)}"
        case Claims():
            return _claims(block)
        case _:
            return block


def _caption(text: str) -> str:
    escaped = text.replace("*", "\\*")
    return f"*{escaped}*" if text else ""


def _claims(claims: Claims) -> str:
    rows = {
        "Verdict": [
            f"{_SIGNS[claim.verdict]} {claim.verdict}".replace(" ", "\u00a0") for claim in claims.claims
        ],
        "Claim": [claim.text for claim in claims.claims],
        "Paper": [claim.paper for claim in claims.claims],
        "Ours": [claim.ours for claim in claims.claims],
        "Why": [claim.why for claim in claims.claims],
    }
    heading = f"**{verdicts(claims.counts)}**"
    return "\n\n".join(x for x in (heading, _caption(claims.caption), markdown(pd.DataFrame(rows))) if x)
