"""The stages by name, with a line of help each; a stage's module is imported when it runs."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from importlib import import_module
from typing import TYPE_CHECKING

from sidegan.errors import ConfigError

if TYPE_CHECKING:  # imports every room: too slow for `--help`
    from sidegan.pipeline.artifact import Artifact
    from sidegan.pipeline.context import RunContext
    from sidegan.pipeline.tracking import Tracker


@dataclass(frozen=True)
class Stage:
    """A part of an experiment that can be run alone, once its inputs exist."""

    # that are made together, in the order of recording
    artifacts: "Callable[[RunContext], Iterable[Artifact]]" = lambda run: ()
    # prints results, and writes them to the run's folder
    show: "Callable[[RunContext, Tracker], None]" = lambda run, tracker: None
    check: "Callable[[RunContext], object]" = lambda run: None  # may refuse a run before its first stage


STAGES = {
    "seeds": "the seed set: optimised trajectories",
    "surrogates": "success predictor and converters, from exactly labelled samples",
    "gan": "a generator of each variant, trained",
    "library": "valid trajectories of each generator",
    "random": "baselines: random valid trajectories, and trajectories of a short search",
    "measures": "how well each set identifies the arm, and how similar it is to the seeds",
    "variations": "seeds, generators and their measures, for several arms or with other settings",
    "long": "the single long trajectory, with few and with many harmonics",
    "selection": "the excitation sets, picked from every pool",
    "identification": "Table I: identification from each set",
    "plant": "the same sets executed by randomised plants in MuJoCo",
    "replication": "Tables II and III: identification from whole sets",
    "subsets": "surrogates and variants on fewer seeds",
    "density": "a kernel density estimate instead of the GAN",
    "timing": "speed of the generators",
    "excite": "trajectories to execute, as files",
    "check": "plausibility of recordings",
    "identify": "a model of a real arm from recordings",
    "payload": "mass, centre of mass and inertia of a load",
    "gains": "drive gains: torque per motor current",
    "table": "the experiment's tables, figures and pages",
}

_MODULES = {  # of stages that are not in a file of their own name
    "surrogates": "training",
    "gan": "training",
    "subsets": "training",
    "library": "selection",
    "random": "baselines",
    "long": "baselines",
    "variations": "measures",
    "plant": "identification",
    "density": "discussion",
    "timing": "discussion",
    "check": "identify",
    "gains": "payload",
}


def stage(name: str) -> Stage:
    """The stage with this name; a ConfigError if there is none."""
    if name not in STAGES:
        raise ConfigError(f"stages: there is no stage {name!r}, expected some of {', '.join(STAGES)}")
    return import_module(f"sidegan.pipeline.stages.{_MODULES.get(name, name)}").STAGES[name]
