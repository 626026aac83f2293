"""Stage objectives: exact physics with other objectives, a library and best sets from each."""

from sidegan.artifacts import Store
from sidegan.config import Config
from sidegan.plan import Task
from sidegan.plan_beyond import with_objectives
from sidegan.stages import best, gan, library
from sidegan.tracking import Tracker


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Train once with each objective, and judge what comes of it."""
    other = with_objectives(Task(cfg, store))
    gan.run(other.cfg, store, tracker)
    library.run(other.cfg, store, tracker)
    best.judge(other, other.short_sets(), tracker)
