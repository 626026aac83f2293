"""Stage surrogates: success predictor and converters, where a variant learns from them."""

import logging

from sidegan.gan.settings import PublishedSurrogates
from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import needed_surrogates
from sidegan.pipeline.task import Task
from sidegan.seeds.published import WEIGHTS

log = logging.getLogger(__name__)


def _artifacts(task: Task) -> list[Artifact]:
    needed = needed_surrogates(task, task.cfg.gan.values())
    if not needed:
        log.info("no surrogates: none of %s learns from them", ", ".join(task.cfg.gan))
    return needed


def _check(task: Task) -> None:
    """Refuse a folder without the weights that are wanted from it."""
    chosen = task.cfg.surrogates
    if isinstance(chosen, PublishedSurrogates) and chosen.shipped:
        for name in WEIGHTS:
            task.cfg.seeds.published.weights(name)


STAGE = Stage(_artifacts, check=_check)
