"""The stages by name, a line each; a stage's module is imported when it runs."""

from importlib import import_module
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from sidegan.pipeline.stage import Stage

STAGES = {
    "seeds": "the seed set: optimised trajectories",
    "surrogates": "success predictor and converters, from exactly labelled samples",
    "gan": "every variant, trained",
    "library": "valid trajectories of each generator",
    "random": "valid trajectories that nobody optimised, the baseline",
    "long": "the single long trajectory in each of its readings",
    "selection": "the excitation sets, picked from every pool",
    "identification": "Table I: identification from each set",
    "plant": "the same sets executed by randomised plants in MuJoCo",
    "replication": "Tables II and III: identification from whole sets",
    "readings": "the same under other readings of the paper's words about noise and recursion",
    "elsewhere": "the arm identified from each set, tested on motions unlike those in it",
    "kinds": "seeds of other kinds",
    "sensitivity": "Table I with one setting changed at a time",
    "subsets": "surrogates and variants on fewer seeds",
    "density": "a kernel density estimate in place of the GAN",
    "ladder": "from the paper's recipe to ours, one change at a time, and ours without each of its parts",
    "quality": "what generated trajectories add to seeds of every quality",
    "timing": "how fast the generators are",
    "first_set": "how long it takes to a first set",
    "polish": "what gradient steps on generated trajectories bring",
    "optimised": "seeds that use as much of the limits as exact variants do",
    "narrow": "seeds blurred a little, the valid ones kept: what a generator has to beat",
    "best": "what the best set of every pool is worth",
    "objectives": "exact variants with other objectives",
    "few_seeds": "exact variants on ever fewer seeds",
    "transfer": "generators for another arm, tool or desk",
    "starts": "what designs start from, made once for an arm in its workspace",
    "worth": "what motions are worth: robot seconds to a good model of plants in MuJoCo",
    "generator": "a generator of what designs start from, trained once for an arm in its workspace",
    "excite": "trajectories to execute, as files",
    "check": "what recordings are worth",
    "identify": "a model of a real arm from recordings",
    "payload": "what an arm carries",
    "gains": "torque per motor current",
    "compare": "what differs between two identifications",
    "recheck": "whether a model is still right",
    "table": "the experiment's tables, figures and pages",
}


def stage(name: str) -> "Stage":
    """The stage of a name."""
    return import_module(f"sidegan.pipeline.stages.{name}").STAGE
