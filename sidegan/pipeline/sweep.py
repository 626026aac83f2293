"""A sweep: its parent run, and the table over all jobs, mean ± standard deviation over random seeds."""

import logging
import re
from collections.abc import Sequence
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any

import yaml
from hydra.experimental.callback import Callback
from omegaconf import DictConfig

from sidegan.base.storage import read_json, write_bytes, write_json
from sidegan.errors import SideganError
from sidegan.pipeline.tracking import Status, Tracker

if TYPE_CHECKING:  # slow to import
    import pandas as pd

_log = logging.getLogger(__name__)

PARENT = "parent.json"  # of a sweep: its run in MLflow, which jobs find in whichever process or machine
STATUS = "status.json"
RESULTS, SWEEP_RESULTS = "results.csv", "sweep_results.csv"  # of a job, and of all jobs, as numbers
_OVERRIDES = Path(".hydra", "overrides.yaml")  # of a job, in its folder

_parent: Tracker | None = None


class SweepCallback(Callback):
    """Hydra callback before and after a sweep."""

    def on_multirun_start(self, config: DictConfig, **kwargs: Any) -> None:
        """Open the parent run."""
        global _parent
        folder = Path(config.hydra.sweep.dir)
        try:
            folder.mkdir(parents=True, exist_ok=True)
        except OSError:  # Hydra fails on it next, and reports the error
            return
        hidden = ("+experiment=", "outputs=")
        words = [word for word in config.hydra.overrides.task if not word.startswith(hidden)]
        name = " ".join([str(config.experiment), "sweep", *words])[:200]
        _parent = Tracker(Path(config.outputs), str(config.experiment), name, str(config.tracking))
        if _parent.run_id:
            write_json(folder / PARENT, {"run": _parent.run_id})

    def on_multirun_end(self, config: DictConfig, **kwargs: Any) -> None:
        """Record the table over all jobs, close the parent run, and exit with the worst job's code."""
        sweep = Path(config.hydra.sweep.dir)
        codes = job_codes(sweep)
        worst = max(codes.values(), default=1)
        try:
            finished = [folder for folder, code in codes.items() if code == 0]
            table = sweep_table(finished)
            if table is not None and _parent is not None:
                from sidegan.report.export import publish

                write_bytes(sweep / SWEEP_RESULTS, job_results(finished).to_csv(index=False).encode())
                caption = f"{config.experiment}, all jobs: mean ± standard deviation over seeds"
                publish(table, sweep / "sweep", caption, _parent)
        except Exception:
            _log.exception("the table over all jobs could not be made")
            worst = max(worst, 1)
        for folder in (folder for folder, code in codes.items() if code):
            _log.error("error: job %s failed, see %s", folder.name, folder)
        end_sweep("FAILED" if worst else "FINISHED")
        if worst:
            raise SystemExit(worst)


def end_sweep(status: Status) -> None:
    """Close the parent run, if one is open."""
    global _parent
    if _parent is not None:
        _parent.finish(status)
    _parent = None


def parent_run(job: Path) -> str | None:
    """ID in MLflow of the sweep that a job's folder belongs to; None outside of sweeps."""
    path = job.parent / PARENT
    return read_json(path)["run"] if path.exists() else None


def job_codes(sweep: Path) -> dict[Path, int]:
    """Exit code of each job of a sweep by its folder, in job order."""
    numbers = {folder: re.match(r"\d+", folder.name) for folder in sweep.iterdir() if folder.is_dir()}
    folders = sorted((int(number[0]), folder) for folder, number in numbers.items() if number)
    codes = dict.fromkeys((folder for _, folder in folders), 1)
    for folder in codes:
        with suppress(SideganError):  # without a status file the job was killed
            codes[folder] = read_json(folder / STATUS)["code"]
    return codes


def leave_results(results: "pd.DataFrame", folder: Path) -> None:
    """Write the numbers that a sweep compares, a row for each set or variant."""
    write_bytes(folder / RESULTS, results.rename_axis("name").to_csv().encode())


def job_results(folders: Sequence[Path]) -> "pd.DataFrame":
    """Numbers of jobs, with the job's name and overrides as columns; empty if no job left any."""
    import pandas as pd

    made = [folder for folder in folders if (folder / RESULTS).exists()]
    rows = [pd.read_csv(folder / RESULTS).assign(job=folder.name, **_overrides(folder)) for folder in made]
    return pd.concat(rows, ignore_index=True) if rows else pd.DataFrame()


def sweep_table(folders: Sequence[Path]) -> "pd.DataFrame | None":
    """Results of jobs, a row for each combination of swept settings and each set or variant.

    A cell is the mean over random seeds, with its standard deviation if there are several.
    """
    import pandas as pd

    from sidegan.report.tables import spread

    table = job_results(folders)
    if table.empty:
        return None
    settings = {key for folder in folders for key in _overrides(folder)} & {*table.columns}
    swept = [key for key in sorted(settings - {"seed"}) if table[key].nunique(dropna=False) > 1]
    keys = [*swept, "name"]
    numbers = [key for key in table.columns if key not in {*settings, "job", "name"}]
    rows = [
        dict(zip(keys, group)) | {key: spread(part[key]) for key in numbers}
        for group, part in table.groupby(keys, sort=False, dropna=False)
    ]
    return pd.DataFrame(rows).set_index(keys)


def _overrides(folder: Path) -> dict[str, str]:
    """Overrides of a job's command, by setting."""
    path = folder / _OVERRIDES
    lines = yaml.safe_load(path.read_text(encoding="utf-8")) if path.exists() else []
    pairs = (line.lstrip("+").split("=", 1) for line in lines)
    return {pair[0]: pair[1] for pair in pairs if len(pair) == 2}
