"""A page as GitHub-flavoured Markdown, from a template, with its tables and figures as files beside it."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sidegan.base.storage import write_bytes
from sidegan.report.export import markdown, write_table
from sidegan.report.style import number, seconds

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure


def write_page(
    path: Path,
    target: Path,
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, "Figure"],
    **context: Any,
) -> str:
    """Write a page as Markdown, and each table and figure that it shows into a folder of the page's name.

    The template calls ``table(name, caption)`` and ``figure(name, caption)``, or ``link(name, caption)`` for
    a table that is not shown; the cells of tables are formatted already. Whatever else it names is the
    context, and numbers are formatted by ``number(".3g")`` and ``seconds``. The Markdown is returned.
    """
    assets = target.with_suffix("")

    def link(name: str, caption: str) -> str:
        write_table(tables[name], assets / "tables" / name, caption)
        return f"[{caption}]({quote(f'{assets.name}/tables/{name}.md')})"

    def table(name: str, caption: str) -> str:
        link(name, caption)
        return f"{_caption(caption)}\n\n{markdown(with_index(tables[name]))}"

    def figure(name: str, caption: str) -> str:
        from sidegan.report.canvas import save

        picture = save(figures[name], assets / "figures" / name).relative_to(target.parent)
        words = caption.replace("[", "(").replace("]", ")")
        return f"![{words}]({quote(picture.as_posix())})\n\n{_caption(caption)}"

    environment = Environment(
        loader=FileSystemLoader(path.parent),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=False,  # it is Markdown; HTML in it is shown and not obeyed
    )
    environment.filters |= {"number": number, "seconds": seconds}
    environment.globals |= {"table": table, "link": link, "figure": figure}
    text = environment.get_template(path.name).render(tables=tables, figures=figures, **context)
    write_bytes(target, text.encode())
    return text


def with_index(table: pd.DataFrame) -> pd.DataFrame:
    """A table whose index is its first column, unless that is a nameless range."""
    nameless = isinstance(table.index, pd.RangeIndex) and table.index.name is None
    return table if nameless else table.reset_index()


def _caption(text: str) -> str:
    escaped = text.replace("*", "\\*")
    return f"*{escaped}*"
