"""A configuration of planar2 that runs in seconds."""

import re
from functools import cache

from hydra import compose, initialize_config_dir

from sidegan.pipeline import callbacks  # noqa: F401 - registers what the paths in conf/ use
from sidegan.pipeline.run import CONF
from sidegan.pipeline.settings import validate

TINY = (
    "scale=tiny",
    "robot=planar2",
    "workspace=free",
    "tracking=off",
    "parallel.workers=1",
    "parallel.threads=1",
    "trajectory.harmonics=3",
    "trajectory.period=8",
    "seeds.samples=20",
    "seeds.batch=20",
    "surrogates.width=16",
    "surrogates.margin_steps=8",
    "surrogates.feature_steps=8",
    "long.period=32",
    "long.harmonics=[3,12]",
    "long.samples=64",
    "selection.count=6",
    "library.batch=60",
    "identification.rate=20",
)


@cache
def composed(*overrides):
    """The composed configuration of a command."""
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("config", overrides=list(overrides))


@cache
def tiny(*overrides, experiment="exp1"):
    """The tiny configuration of an experiment with changes."""
    chosen = f"+experiment={experiment}"
    own = [one for one in TINY if re.match(r"\w+", one)[0] in composed(chosen)]
    return validate(composed(chosen, *own, *overrides))
