"""Pages from templates: Markdown with its tables and figures as files beside it, and HTML as one file."""

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TYPE_CHECKING, Any
from urllib.parse import quote

import pandas as pd
from jinja2 import Environment, FileSystemLoader, StrictUndefined

from sidegan.base.names import plain
from sidegan.base.storage import write_bytes
from sidegan.report.export import markdown, write_table

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure


def write_page(
    path: Path,
    target: Path,
    tables: Mapping[str, pd.DataFrame],
    figures: Mapping[str, "Figure"],
    **context: Any,
) -> None:
    """Write a page as Markdown, and each table and figure that it shows into a folder of the page's name.

    The template calls ``table(name, caption)`` and ``figure(name, caption)``, or ``link(name, caption)`` for
    a table that is not shown; the cells of tables are formatted already. Whatever else it names is the
    context, and numbers are formatted by ``number(".3g")``.
    """
    assets = target.with_suffix("")

    def link(name: str, caption: str) -> str:
        write_table(tables[name], assets / "tables" / name, caption)
        return f"[{caption}]({quote(f'{assets.name}/tables/{name}.md')})"

    def table(name: str, caption: str) -> str:
        link(name, caption)
        return f"{_caption(caption)}\n\n{markdown(tables[name].reset_index())}"

    def figure(name: str, caption: str) -> str:
        from sidegan.report.canvas import save

        picture = save(figures[name], assets / "figures" / name).relative_to(target.parent)
        words = caption.replace("[", "(").replace("]", ")")
        return f"![{words}]({quote(picture.as_posix())})\n\n{_caption(caption)}"

    words = {"table": table, "link": link, "figure": figure, "tables": tables, "figures": figures}
    environment = templates(path.parent, html=False)  # HTML in Markdown is shown and not obeyed
    environment.filters |= {"number": plain}
    text = environment.get_template(path.name).render(**words, **context)
    write_bytes(target, text.encode())


def templates(folder: Path, html: bool) -> Environment:
    """Templates below a folder; what they do not know is an error."""
    return Environment(
        loader=FileSystemLoader(folder),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=html,
    )


def web_page(name: str, filters: Mapping[str, Callable[..., str]] | None = None, **context: Any) -> bytes:
    """An HTML page that is one file, by a template of this room; nothing in it comes from the network."""
    environment = templates(Path(__file__).parent, html=True)
    environment.filters |= filters or {}
    return environment.get_template(name).render(**context).encode()


def _caption(text: str) -> str:
    escaped = text.replace("*", "\\*")
    return f"*{escaped}*"
