"""Stage check: what recordings are worth, before anything is fitted to them."""

from sidegan.errors import ConfigError
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.identify import checked
from sidegan.pipeline.task import Task
from sidegan.pipeline.tracking import Tracker
from sidegan.report.identification import write_checks
from sidegan.robot import load_robot


def _show(task: Task, tracker: Tracker) -> None:
    """Read and check the configured recordings, and leave what the check says in the run's folder."""
    if not task.cfg.recordings:
        raise ConfigError("recordings is empty, expected files to check: 'recordings=[a.csv,b.csv]'")
    training, validation = checked(task.cfg, load_robot(task.cfg.robot.name, task.cfg.robot.setup))
    path = write_checks([*training, *validation], task.store.run_folder)
    tracker.log_artifact(path, "identify")


STAGE = Stage(show=_show)
