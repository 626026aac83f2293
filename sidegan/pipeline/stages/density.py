"""Stage density: a kernel density estimate of the seeds instead of the GAN."""

import numpy as np
import pandas as pd

from sidegan.base.arrays import flatten
from sidegan.base.storage import write_parquet
from sidegan.design.fidelity import distance_to
from sidegan.errors import ConfigError
from sidegan.gan.metrics import measure
from sidegan.pipeline.artifact import Artifact, Build
from sidegan.pipeline.context import RESULTS, RunContext
from sidegan.pipeline.stage import Stage
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.training import taught, training_seeds
from sidegan.report.tables import arrow


def density(run: RunContext) -> Artifact:
    """Validity, fitness and diversity of samples from density estimates."""
    settings = {"bandwidths": run.cfg.discussion.bandwidths, "draws": run.cfg.discussion.draws}
    settings |= taught(run)
    return run.artifact("density", "kde", _make, settings, {"seeds": seed_set(run)})


def _make(run: RunContext, build: Build) -> None:
    """Sample a Gaussian kernel density estimate of the seeds at each bandwidth.

    Source: Scott 1992, Multivariate density estimation (bandwidth); the kernel has the seeds' covariance.
    """
    from scipy.stats import gaussian_kde

    seeds = training_seeds(run).coefficients
    if len(seeds) <= seeds[0].size:
        raise ConfigError(
            f"a density estimate needs more seeds than coefficients: {len(seeds)} and {seeds[0].size}"
        )
    estimate = gaussian_kde(flatten(seeds, 1).T)
    rows = []
    for bandwidth in run.cfg.discussion.bandwidths:
        estimate.set_bandwidth(bandwidth * estimate.scotts_factor())
        random = np.random.default_rng(run.random(f"density {bandwidth}"))
        drawn = estimate.resample(run.cfg.discussion.draws, random)
        c = np.ascontiguousarray(drawn.T).reshape(-1, *seeds.shape[1:])
        row = {"bandwidth": bandwidth, "factor": float(estimate.factor), "from_seed": distance_to(c, seeds)}
        rows.append(row | measure(run.cell.constraints, run.cell.trajectory, c, seeds))
    write_parquet(build.folder / RESULTS, arrow(pd.DataFrame(rows)))


STAGES = {"density": Stage(lambda run: [density(run)])}
