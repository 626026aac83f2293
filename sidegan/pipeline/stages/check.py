"""Stage check: what recordings are worth, before anything is fitted to them."""

from sidegan.errors import ConfigError
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.identify import checked, recorded_arm
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.identification import write_checks


def _show(task: Task, tracker: Tracker) -> None:
    """Read and check the configured recordings, and leave what the check says in the run's folder."""
    if not task.cfg.recordings:
        raise ConfigError("recordings is empty, expected files to check: 'recordings=[a.csv,b.csv]'")
    training, validation = checked(task.cfg, recorded_arm(task))
    path = write_checks([*training, *validation], task.store.run_folder)
    tracker.log_artifact(path, "identify")


STAGE = Stage(show=_show, check=lambda task: recorded_arm(task))
