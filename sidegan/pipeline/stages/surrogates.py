"""Stage surrogates: success predictor and converters, where a variant learns from them."""

import logging

from sidegan.pipeline.graph import Artifact
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.training import needed_surrogates
from sidegan.pipeline.task import Task

log = logging.getLogger(__name__)


def _artifacts(task: Task) -> list[Artifact]:
    needed = needed_surrogates(task, task.cfg.gan.values())
    if not needed:
        log.info("no surrogates: none of %s learns from them", ", ".join(task.cfg.gan))
    return needed


STAGE = Stage(_artifacts)
