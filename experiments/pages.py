"""The paper's numbers and claims, and results of an experiment as files and records."""

from collections.abc import Mapping
from pathlib import Path
from typing import TYPE_CHECKING

import pandas as pd
import yaml

from sidegan.pipeline.sweep import leave_results
from sidegan.pipeline.tracking import Tracker
from sidegan.report import export

if TYPE_CHECKING:  # slow to import
    from matplotlib.figure import Figure

FOLDER = Path(__file__).parent
DOCS = FOLDER.parent / "docs"
PAPER, COLUMNS = (
    yaml.safe_load((FOLDER / f"{name}.yaml").read_text(encoding="utf-8")) for name in ("paper", "columns")
)


def target_of(page: str, publish: str | None, folder: Path) -> Path:
    """Where a page is written: ``publish``, a folder or the page's own name, or else the run's folder."""
    target = Path(publish or folder)
    return target if target.suffix == ".md" else target / f"{page}.md"


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
        tracker: to record them.
        tables: formatted tables with captions, by file name.
        results: numbers that a sweep compares, a row for each set or variant.
        figures: by file name.
    """
    from sidegan.report.canvas import save

    for name, (table, caption) in tables.items():
        export.publish(table, folder / name, caption, tracker)
    leave_results(results, folder)
    for name, figure in (figures or {}).items():
        tracker.log_artifact(save(figure, folder / name), "figures")
