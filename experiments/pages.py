"""How the results of an experiment are left and recorded: tables and figures alone, or a page of them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
import pandas as pd

from sidegan.base.storage import write_json
from sidegan.pipeline.graph import folder_name
from sidegan.pipeline.tracking import Tracker
from sidegan.report import export
from sidegan.report.document import write_page
from sidegan.report.web import write_html

if TYPE_CHECKING:  # slow to import
    import plotly.graph_objects as go
    from matplotlib.figure import Figure

_TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Page:
    """What a page is made from.

    Attributes:
        name: of the page, of its template and of the folder of its tables and figures.
        tables: for people, by the name of their file.
        figures: by the name of their file.
        metrics: the numbers that a later run is compared by, a file of a few for every row.
        context: whatever else the template names.
        interactive: figures of the same names for an HTML page; None where there is no such page.
    """

    name: str
    tables: Mapping[str, pd.DataFrame]
    figures: Mapping[str, "Figure"]
    metrics: Mapping[str, Mapping[str, float]]
    context: Mapping[str, Any]
    interactive: "Mapping[str, go.Figure] | None" = field(default=None)


def publish(page: Page, folder: Path, tracker: Tracker) -> None:
    """Write a page into a folder, and record it with its metrics."""
    target = folder / f"{page.name}.md"
    text = write_page(_TEMPLATES / f"{page.name}.md.j2", target, page.tables, page.figures, **page.context)
    if page.interactive is not None:
        target = target.with_suffix(".html")
        write_html(text, target, page.interactive)
    for name, numbers in page.metrics.items():
        write_json(folder / page.name / "metrics" / f"{name}.json", dict(numbers))
    tracker.log_artifact(target, "report")
    for name, table in page.tables.items():
        shown = table.reset_index().astype(str) if any(table.index.names) else table.astype(str)
        tracker.log_table(shown, name)
        tracker.log_note(f"**{name}**\n\n{export.markdown(shown)}")
    tracker.log_metrics(
        {f"{name}/{key}": x for name, numbers in page.metrics.items() for key, x in numbers.items()}
    )


def means(frame: pd.DataFrame, by: str, keys: Iterable[str]) -> dict[str, dict[str, float]]:
    """Metrics of a page: the mean of each column that is known, by the values of the column ``by``."""
    rows = frame.groupby(by, sort=False)[list(keys)].mean().to_dict("index")
    return {
        folder_name(str(name)): {str(key): float(f"{x:.4g}") for key, x in row.items() if np.isfinite(x)}
        for name, row in rows.items()
    }


def leave(
    folder: Path,
    tracker: Tracker,
    tables: Mapping[str, tuple[pd.DataFrame, str]],
    figures: "Mapping[str, Figure] | None" = None,
) -> None:
    """Print, write and record tables, each with its caption, and figures, by the name of their files."""
    from sidegan.report.canvas import save

    for name, (table, caption) in tables.items():
        export.publish(table, folder / name, caption, tracker)
    for name, figure in (figures or {}).items():
        tracker.log_artifact(save(figure, folder / name), "figures")
