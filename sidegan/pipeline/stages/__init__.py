"""The stages by name, with a line of help each; a stage's module is imported when it runs."""

from importlib import import_module
from typing import TYPE_CHECKING

from sidegan.errors import ConfigError

if TYPE_CHECKING:
    from sidegan.pipeline.stage import Stage

STAGES = {
    "seeds": "the seed set: optimised trajectories",
    "surrogates": "success predictor and converters, from exactly labelled samples",
    "gan": "every variant, trained",
    "library": "valid trajectories of each generator",
    "random": "baselines: random valid trajectories, and those of a short search",
    "measures": "what the trajectories of each are worth, and how they are like the seeds",
    "arms": "all of the above, for several arms",
    "long": "the single long trajectory in each of its readings",
    "selection": "the excitation sets, picked from every pool",
    "identification": "Table I: identification from each set",
    "plant": "the same sets executed by randomised plants in MuJoCo",
    "replication": "Tables II and III: identification from whole sets",
    "subsets": "surrogates and variants on fewer seeds",
    "density": "a kernel density estimate in place of the GAN",
    "timing": "how fast the generators are",
    "excite": "trajectories to execute, as files",
    "check": "what recordings are worth",
    "identify": "a model of a real arm from recordings",
    "payload": "what an arm carries",
    "gains": "torque per motor current",
    "table": "the experiment's tables, figures and pages",
}

_MODULES = {"random": "baselines", "long": "baselines", "surrogates": "training", "gan": "training"}
_MODULES |= {"subsets": "training", "plant": "identification", "check": "identify", "gains": "payload"}


def stage(name: str) -> "Stage":
    """The stage with this name; a ConfigError if there is none."""
    if name not in STAGES:
        raise ConfigError(f"stages: there is no stage {name!r}, expected some of {', '.join(STAGES)}")
    return import_module(f"sidegan.pipeline.stages.{_MODULES.get(name, name)}").STAGES[name]
