"""Stage density: a kernel density estimate of the seeds instead of a GAN."""

import logging
from functools import partial
from pathlib import Path

import numpy as np
import pandas as pd
import torch

from sidegan.base.storage import write_parquet
from sidegan.errors import ConfigError
from sidegan.gan.metrics import measure
from sidegan.pipeline.artifacts import Store
from sidegan.pipeline.config import Config
from sidegan.pipeline.plan import RESULTS, Task
from sidegan.pipeline.stages.common import training_seeds
from sidegan.pipeline.tracking import Tracker
from sidegan.report.tables import arrow

log = logging.getLogger(__name__)


def run(cfg: Config, store: Store, tracker: Tracker) -> None:
    """Measure samples of the density estimate."""
    task = Task(cfg, store)
    folder = store.produce(task.density, partial(_density, task))
    for row in pd.read_parquet(folder / RESULTS).to_dict("records"):
        log.info(
            "kernel density estimate, %g of Scott's bandwidth: %.4f valid", row["bandwidth"], row["success"]
        )


def _density(task: Task, folder: Path, work: Path) -> None:
    """Validity, fitness and diversity of samples of a Gaussian kernel density estimate of the seeds.

    Source: Scott 1992, Multivariate density estimation (bandwidth); the kernel has the seeds' covariance.
    """
    from scipy.stats import gaussian_kde

    seeds = training_seeds(task).coefficients
    if len(seeds) <= seeds[0].numel():
        raise ConfigError(
            f"a density estimate needs more seeds than coefficients: {len(seeds)} and {seeds[0].numel()}"
        )
    wanted, rows = task.cfg.discussion, []
    for bandwidth in wanted.bandwidths:
        flat = seeds.flatten(1).numpy().T
        estimate = gaussian_kde(flat)
        estimate.set_bandwidth(bandwidth * estimate.scotts_factor())
        drawn = estimate.resample(wanted.draws, np.random.default_rng(task.random(f"density {bandwidth}")))
        c = torch.from_numpy(np.ascontiguousarray(drawn.T)).reshape(-1, *seeds.shape[1:])
        distance = torch.cdist(c.flatten(1), seeds.flatten(1)).amin(1).mean()
        facts = measure(task.constraints, task.trajectory, c)
        rows.append(
            {"bandwidth": bandwidth, "factor": estimate.factor, "from_seed": float(distance), **facts}
        )
    write_parquet(folder / RESULTS, arrow(pd.DataFrame(rows)))
