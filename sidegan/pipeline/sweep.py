"""The table over all jobs of a sweep: what each left as its results, mean ± spread over random seeds."""

from collections.abc import Iterable
from pathlib import Path
from typing import TYPE_CHECKING

import yaml

from sidegan.base.storage import write_bytes

if TYPE_CHECKING:  # slow to import
    import pandas as pd

RESULTS = "results.csv"
TABLE = "sweep"  # name of the table's files
_OVERRIDES = Path(".hydra", "overrides.yaml")  # of a job, in its folder
_SEED = "seed"


def leave_results(results: "pd.DataFrame", folder: Path) -> None:
    """Write the numbers of a run that a sweep compares, a row for each set or variant."""
    write_bytes(folder / RESULTS, results.rename_axis("name").to_csv().encode())


def sweep_table(folders: Iterable[Path]) -> "pd.DataFrame | None":
    """Results of jobs, a row for each combination of swept settings and each set or variant.

    A cell is the mean over random seeds, with its standard deviation where there are several of them.
    """
    import pandas as pd

    from sidegan.report.tables import spread

    jobs = [
        pd.read_csv(folder / RESULTS).assign(**_overrides(folder))
        for folder in folders
        if (folder / RESULTS).exists()
    ]
    if not jobs:
        return None
    settings = {key for folder in folders for key in _overrides(folder)}
    both = pd.concat(jobs, ignore_index=True)
    swept = [key for key in sorted(settings - {_SEED}) if both[key].nunique(dropna=False) > 1]
    keys = [*swept, "name"]
    numbers = [key for key in both.columns if key not in settings and key != "name"]
    rows = [
        dict(zip(keys, group)) | {key: spread(part[key]) for key in numbers}
        for group, part in both.groupby(keys, sort=False, dropna=False)
    ]
    return pd.DataFrame(rows).set_index(keys)


def _overrides(folder: Path) -> dict[str, str]:
    """Overrides of a job's command, by setting."""
    path = folder / _OVERRIDES
    lines = yaml.safe_load(path.read_text(encoding="utf-8")) if path.exists() else []
    pairs = (line.lstrip("+").split("=", 1) for line in lines)
    return {pair[0]: pair[1] for pair in pairs if len(pair) == 2}
