"""A configuration of planar2 that runs in seconds."""

import re
from functools import cache

from hydra import compose, initialize_config_dir
from hydra.core.override_parser.overrides_parser import OverridesParser
from omegaconf import OmegaConf

from sidegan.base.conf import CONF
from sidegan.pipeline.settings import offer, validate

TINY = (
    "scale=tiny",
    "robot=planar2",
    "workspace=free",
    "seeds=gradient",
    "seeds.count=40",
    "tracking=off",
    "parallel.workers=1",
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
    "plants.plant.rate=250",
)


offer()

# What keeps an experiment small besides; artifacts that several tests use are made with these settings alone.
SMALL = {
    "excite": ("controllers.rate=20", "goal.count=6", "search.evaluations=60", "search.patience=60"),
    "reproduction": ("trainings=[0,1]", "discussion.sizes=[20]", "discussion.draws=30"),
}


@cache
def _groups(*overrides):
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("config", overrides=list(overrides))


def composed(*overrides):
    """The composed configuration of a command; groups, which take long, are composed once."""
    parsed = OverridesParser.create().parse_overrides(list(overrides))
    values = [override for override in parsed if not (CONF / override.key_or_group).is_dir()]
    groups = [override.input_line for override in parsed if override not in values]
    cfg = _groups(*groups).copy()
    for override in values:
        OmegaConf.update(cfg, override.key_or_group, override.value(), force_add=override.is_add())
    return cfg


@cache
def tiny(*overrides, experiment="exp1"):
    """The tiny configuration of an experiment with changes."""
    chosen = f"+experiment={experiment}"
    keys, small = _groups(chosen).keys(), [*TINY, *SMALL.get(experiment, ())]
    own = [override for override in small if re.match(r"[~+]*(\w+)", override)[1] in keys]
    if "condition" not in keys or any(
        override.startswith(("seeds=", "condition=")) for override in overrides
    ):
        own = [override for override in own if override != "seeds=gradient"]
    if "condition=published" in overrides:  # whose surrogates have no such settings
        own = [override for override in own if not override.startswith("surrogates.")]
    return validate(composed(chosen, *own, *overrides))
