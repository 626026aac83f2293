"""Pages from templates: Markdown with tables and figures in separate files, and self-contained HTML."""

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
    """Write a Markdown page, and the tables and figures that it uses into a folder of the same name.

    The template calls ``table(name, caption)`` and ``figure(name, caption)``, or ``link(name, caption)`` for
    a table that is only linked; cells of tables are already formatted. Other names come from the context,
    and ``number(".3g")`` formats numbers.
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
    write_bytes(target, rendered(path, {"number": plain}, **words, **context))


def rendered(path: Path, filters: Mapping[str, Callable[..., str]], **context: Any) -> bytes:
    """A filled template, which may include others of its folder and of this room; undefined names fail."""
    environment = Environment(
        loader=FileSystemLoader([path.parent, Path(__file__).parent]),
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        keep_trailing_newline=True,
        autoescape=path.name.endswith(".html.jinja"),  # Markdown and C need no escapes
    )
    environment.filters |= filters
    return environment.get_template(path.name).render(**context).encode()


def _caption(text: str) -> str:
    escaped = text.replace("*", "\\*")
    return f"*{escaped}*"
