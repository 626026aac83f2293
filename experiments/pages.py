"""Results of an experiment as files and records: tables and figures alone, or a page of them."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import pandas as pd

from sidegan.base.storage import write_json
from sidegan.pipeline.sweep import leave_results
from sidegan.pipeline.tracking import Tracker
from sidegan.report import export
from sidegan.report.document import write_page

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

_TEMPLATES = Path(__file__).parent / "templates"


@dataclass(frozen=True)
class Page:
    """Content of a page.

    Attributes:
        name: of the page, of its template and of the folder of its tables and figures.
        tables: for people, by the name of their file.
        figures: by the name of their file.
        metrics: the numbers that a later run is compared by, a file of a few for every row.
        context: whatever else the template names.
    """

    name: str
    tables: Mapping[str, pd.DataFrame]
    figures: Mapping[str, "Figure"]
    metrics: Mapping[str, Mapping[str, float]]
    context: Mapping[str, Any]


def publish(page: Page, folder: Path, tracker: Tracker) -> None:
    """Write a page into a folder, and record it with its metrics."""
    target = folder / f"{page.name}.md"
    write_page(_TEMPLATES / f"{page.name}.md.j2", target, page.tables, page.figures, **page.context)
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


def leave(
    folder: Path,
    tracker: Tracker,
    tables: Mapping[str, tuple[pd.DataFrame, str]],
    results: pd.DataFrame,
    figures: "Mapping[str, Figure] | None" = None,
) -> None:
    """Print, write and record the results of a run.

    Args:
        folder: of the run.
        tracker: records them.
        tables: for people, each with its caption, by the name of their files.
        results: numbers by which the jobs of a sweep are compared, a row for each set or variant.
        figures: by the name of their files.
    """
    from sidegan.report.canvas import save

    for name, (table, caption) in tables.items():
        export.publish(table, folder / name, caption, tracker)
    leave_results(results, folder)
    for name, figure in (figures or {}).items():
        tracker.log_artifact(save(figure, folder / name), "figures")
