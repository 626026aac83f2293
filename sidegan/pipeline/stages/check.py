"""Stage check: what recordings are worth, before anything is fitted to them."""

from sidegan.errors import ConfigError
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.stages.identify import checked
from sidegan.pipeline.tracking import Tracker
from sidegan.report.identification import write_checks
from sidegan.robot import load_robot


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Read and check the configured recordings, and leave what the check says in the run's folder.

    Raises:
        ConfigError: when no recordings are given.
        RecordingError: when one cannot be used.
    """
    if not cfg.recordings:
        raise ConfigError("recordings is empty, expected files to check: 'recordings=[a.csv,b.csv]'")
    training, validation = checked(cfg, load_robot(cfg.robot.name))
    tracker.log_artifact(write_checks([*training, *validation], store.run_folder), "identify")
