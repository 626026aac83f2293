"""A configuration of planar2 that runs in seconds."""

import re
from functools import cache

from hydra import compose, initialize_config_dir
from hydra._internal.config_loader_impl import ConfigLoaderImpl
from hydra.core.override_parser.overrides_parser import OverridesParser

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
    "surrogates.shallow.width=16",
    "long.period=32",
    "long.harmonics=[3,12]",
    "long.samples=64",
    "long.starts=8",
    "selection.count=6",
    "library.batch=60",
    "identification.rate=20",
)


# What keeps an experiment small besides; artifacts that several tests use are made with these settings alone.
SMALL = {
    "excite": ("controllers.rate=20",),
    "reproduction": (
        "trainings=[0,1]",
        "discussion.sizes=[20]",
        "discussion.draws=30",
        "sensitivity.priors=[1]",
        "recursions=[{prior:1e6,forgetting:1},{prior:1e-6,forgetting:1},{prior:1e6,forgetting:0.99}]",
        "sensitivity.counts=[2]",
        "~sensitivity.noises.additive",
        "~columns.letter_second",
        "~columns.ours_on_paper",
        "~columns.ours_second",
        "+columns.letter_first.trainings=[0]",
        "columns.letter_first.seeds.steps=3",
        "columns.letter_first.seeds.ants=10",
        "columns.letter_first.seeds.evaluations=40",
        "columns.letter_first.seeds.samples=20",
        "columns.letter_first.kinds.diagonal.steps=3",
        "columns.letter_first.kinds.diagonal.ants=10",
        "columns.letter_first.kinds.diagonal.evaluations=40",
        "columns.letter_first.kinds.diagonal.samples=20",
        "columns.letter_first.long.period=32",
        "columns.letter_first.long.harmonics=[3,12]",
        "columns.letter_first.long.samples=64",
    ),
    "beyond": (
        "trainings=[0,1]",
        "gan=[vanilla,eigen,exact,exact_adversarial]",
        "~beyond.objectives.changes.exact_determinant",
        "~beyond.objectives.changes.exact_variance",
        "~beyond.objectives.changes.exact_diagonal",
        "beyond.steps=[3]",
        "beyond.finish=3",
        "beyond.sizes=[10]",
        "beyond.repeats=2",
        "discussion.sizes=[10]",  # no subset that the reproduction makes: the page shows what there is
        "beyond.epoch=2",
        "~beyond.targets.another_arm",
        "~beyond.targets.higher_desk",
    ),
    "ladder": (
        "~ladder.changes.logs",
        "~ladder.changes.perceptron",
        "~ladder.changes.whitened",
        "~ladder.changes.gaussian",
        "~ladder.changes.gradient_penalty",
        "~ladder.changes.rates",
        "~ladder.changes.minibatch",
        "~ladder.changes.generator",
        "~ladder.changes.limited",
        "~ladder.changes.predictor",
        "~ladder.changes.converter",
        "~ladder.changes.diversity",
        "~ladder.changes.weights",
        "~ladder.changes.averaged",
        "~ladder.changes.repaired_range",
        "~ladder.changes.repaired_unlimited",
        "~ladder.changes.repaired_printed",
        "~ladder.changes.repaired_weights",
        "~ladder.changes.repaired_narrow",
        "~ablation.changes.eigen_narrow",
        "~ablation.changes.eigen_conv",
        "~ablation.changes.eigen_range",
        "~ablation.changes.eigen_unlimited",
        "~ablation.changes.eigen_last",
        "~ablation.changes.eigen_undiverse",
        "~ablation.changes.eigen_adversarial",
    ),
    "quality": (
        "~columns.steps_16",
        "~columns.steps_24",
        "~columns.ours_on_paper",
        "columns.steps_8.seeds.samples=20",
        "columns.steps_8.seeds.batch=20",
    ),
    "worth": (
        "~worth.contenders.sinusoids",
        "~worth.contenders.chirp",
        "~worth.contenders.random_16",
        "~worth.contenders.condition",
        "~worth.contenders.excite",
        "~worth.contenders.rigid_volume",
        "~worth.contenders.volume",
        "~worth.contenders.prediction_16",
        "~worth.contenders.single",
        "~worth.regimes.second",
    ),
    "design": (
        "designer.library.count=3",
        "designer.library.steps=20",
        "design.evaluations=5",
        "generator.modes=3",
        "generator.width=8",
        "generator.situations=6",
        "generator.steps=4",
        "generator.batch=4",
        "stages=[starts,generator,table]",
    ),
}


@cache
def _groups(*overrides):
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("config", overrides=list(overrides))


def composed(*overrides):
    """The composed configuration of a command; groups, which take long, are composed once."""
    parsed = OverridesParser.create().parse_overrides(list(overrides))
    values = [one for one in parsed if not (CONF / one.key_or_group).is_dir()]
    groups = [one.input_line for one in parsed if one not in values]
    cfg = _groups(*groups).copy()
    ConfigLoaderImpl._apply_overrides_to_config(values, cfg)
    return cfg


@cache
def tiny(*overrides, experiment="exp1"):
    """The tiny configuration of an experiment with changes."""
    chosen = f"+experiment={experiment}"
    keys, small = _groups(chosen).keys(), [*TINY, *SMALL.get(experiment, ())]
    own = [one for one in small if re.match(r"[~+]*(\w+)", one)[1] in keys]
    return validate(composed(chosen, *own, *overrides))
