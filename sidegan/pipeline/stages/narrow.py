"""Stage narrow: seeds blurred a little, the valid ones of which are kept: what a generator has to beat."""

import time

import numpy as np
from torch import Tensor

from sidegan.base.storage import write_json
from sidegan.library.draw import draw_valid
from sidegan.library.measure import measured, summary
from sidegan.pipeline.graph import Artifact, Build
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.density import blurred
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import taught, training_seeds
from sidegan.pipeline.task import LIBRARY, REPORT, Task

NARROW = "narrow"
_MOST = 50  # draws per trajectory wanted


def narrow(task: Task) -> Artifact:
    """Valid samples of a narrow density estimate of the seeds; what one takes is a cost."""
    settings = {"bandwidth": task.cfg.beyond.bandwidth, "count": task.cfg.library.count}
    settings |= {"batch": task.cfg.library.batch, "least": task.cfg.selection.count, **taught(task)}
    return task.artifact("narrow", "kde", _make, settings, {"seeds": seed_set(task)}, alone=True)


def _make(task: Task, build: Build) -> None:
    """As many as each generator makes."""
    count, random = task.cfg.library.count, np.random.default_rng(task.random("narrow"))
    draw = blurred(training_seeds(task).coefficients, task.cfg.beyond.bandwidth)

    def sample(number: int) -> Tensor:
        return draw(number, random)[0]

    began = time.process_time()
    draws = draw_valid(
        sample, task.check, count, task.cfg.library.batch, _MOST * count, report=build.report
    ).require(task.cfg.selection.count, "drawn from a narrow density estimate")
    build.costs["each"] = (time.process_time() - began) / draws.valid
    library = measured(task.constraints, task.trajectory, draws.coefficients, NARROW)
    library.save(build.folder / LIBRARY)
    share = {"drawn": draws.drawn, "valid_share": draws.valid / draws.drawn}
    write_json(build.folder / REPORT, share | summary(library))


STAGE = Stage(lambda task: [narrow(task)])
