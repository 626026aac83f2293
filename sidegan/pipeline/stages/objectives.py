"""Stage objectives: exact physics with other objectives, a library and best sets from each."""

from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import Task
from sidegan.pipeline.plan_beyond import with_objectives
from sidegan.pipeline.stages import best, gan, library
from sidegan.pipeline.tracking import Tracker


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train once with each objective, and judge what comes of it."""
    other = with_objectives(Task(cfg, store))
    gan.run(other.cfg, store, tracker)
    library.run(other.cfg, store, tracker)
    best.judge(other, other.short_sets(), tracker)
