"""Every option of conf/ is valid, and settings reach the groups that refer to them."""

import shlex
from dataclasses import replace
from itertools import zip_longest

import pytest
from hydra.core.override_parser.overrides_parser import OverridesParser
from hypothesis import example, given
from hypothesis import strategies as st
from omegaconf import OmegaConf

from sidegan.base.conf import CONF, options
from sidegan.base.names import dotted
from sidegan.errors import ConfigError
from sidegan.gan.settings import variant_recipe
from sidegan.pipeline.settings import Config, validate
from sidegan.robot import Limits, Setup, changes, setting
from sidegan.seeding import seeds_recipe
from tests import tiny
from tests.refusals import refused


def configured(*overrides, experiment="reproduction"):
    return validate(tiny.composed(f"+experiment={experiment}", *overrides))


GROUPS = {  # options of groups, in an experiment that has them
    "training": ["gan", "seeds", "surrogates"],
    "payload": ["robot", "recording", "model"],
    "exp1": ["plants"],
    "excite": ["workspace"],
}
TOGETHER = [("training", (f"condition={name}",)) for name in options("condition")] + [
    (experiment, tuple(f"{group}={option}" for group, option in zip(groups, chosen) if option))
    for experiment, groups in GROUPS.items()
    for chosen in zip_longest(*map(options, groups))
]


@pytest.mark.parametrize(("experiment", "overrides"), TOGETHER)
def test_every_option_of_every_group_is_valid(experiment, overrides):
    folder = ["seeds.folder=there"] if "published" in " ".join(overrides) else []
    assert isinstance(configured(*overrides, *folder, experiment=experiment), Config)


def test_every_group_has_its_options_tested():
    tested = {group for groups in GROUPS.values() for group in groups} | {"condition", "scale", "experiment"}
    folders = {path.name for path in CONF.iterdir() if path.is_dir()}
    assert folders == tested | {"hydra", "base", "recorded"}


@pytest.mark.parametrize("experiment", options("experiment"))
def test_every_experiment_is_valid(experiment):
    config = configured(experiment=experiment)
    assert config.experiment == experiment and config.stages


@pytest.mark.parametrize("scale", options("scale"))
def test_every_scale_is_valid_and_has_what_the_experiments_take_from_one(scale):
    config = configured(f"scale={scale}")
    assert config.scale["name"] == scale and config.scale.keys() == configured().scale.keys()


def test_the_package_has_the_variants_and_optimisers_of_conf():
    variants = configured("condition=gradient", "gan=all", "scale=quick").gan
    assert {name: variant_recipe(name) for name in variants} == variants
    for method in ("gradient", "paper"):
        seeds = configured(f"seeds={method}", "scale=quick").seeds
        assert replace(seeds, shipped=None) == seeds_recipe(method)


def test_a_command_composes_only_the_groups_it_uses():
    config = configured("robot=ur10e", experiment="identify")
    assert not config.has("gan") and not config.has("seeds") and config.has("recording", "model")
    assert len(dotted(config.plain())) <= 80
    with refused(ConfigError, "seeds="):
        config.seeds.count  # noqa: B018
    assert (config.recording.cutoff, config.model.rotor_inertia) == (5, True)


def test_the_scale_applies_to_chosen_groups():
    config = configured("scale=paper", "gan=eigen")
    assert list(config.gan) == ["eigen"] and config.gan["eigen"].epochs == config.scale["gan_epochs"] == 50
    assert (config.seeds.count, config.library.count, config.selection.count) == (1800, 4200, 35)


def test_a_condition_sets_recipe_and_seeds_and_can_be_overridden():
    ours, gradient = (configured(f"condition={name}") for name in ("ours", "gradient"))
    assert ours.gan == gradient.gan and gradient.seeds.method == "gradient" and ours.seeds.method == "paper"
    chosen = configured("seeds=gradient", "condition=ours", "condition.name=theirs", "seed=7")
    assert (chosen.seeds.method, chosen.condition.name, chosen.seed) == ("gradient", "theirs", 7)
    assert configured("condition=ours", "gan=eigen").gan.keys() == {"eigen"}


SETUPS = [
    Setup(),
    Setup(tip="left/hand", locked={"finger_joint": 0.02, "torso": -1.5}),
    Setup(args={"ur_type": "ur5e", "prefix": "a b"}),
    Setup(mount=(0.5, -1.25, 0.0), may_touch=[("link_5", "link_7"), ("a", "b")]),
    Setup(limits=Limits(velocity={"j": 1.5}, position={"j": (-1.0, 2.0)}, effort={"k": 3.0})),
    *(
        Setup(args={name: "0.5"}, tip=name, locked={name: -0.5}, limits=Limits(jerk={name: 1e3}))
        for name in ("elbow", "joint_8.0", "body_1/left-arm", "j 1", "7")
    ),
]


TEXT = st.text("ab1/._-~ ,:;='\"\\\\$%&#@!|?*+<>()[]{}ä…\t\n", max_size=12).filter(lambda text: text != "…")
NAME = st.text("ab /._-,:=()[]{}", min_size=1, max_size=8).filter(lambda name: name == name.strip())
VALUES = st.recursive(
    TEXT | st.integers() | st.floats(allow_nan=False) | st.booleans() | st.none(),
    lambda inner: st.lists(inner, max_size=3) | st.dictionaries(NAME, inner, max_size=3),
    max_leaves=5,
)


@given(VALUES)
@example(["/home/me/my logs/a, b.csv", "~/ä.csv", ".5"])
@example("C:\\logs\\")
@example("${oc.env:HOME}\\${x}\\")
def test_any_printed_setting_is_read_as_it_was(value):
    (word,) = shlex.split(setting("x", value))
    read = OverridesParser.create().parse_override(word).value()
    assert OmegaConf.to_container(OmegaConf.create({"x": read}), resolve=True) == {"x": value}


@pytest.mark.parametrize("setup", SETUPS)
def test_printed_robot_settings_can_be_typed_back(setup):
    typed = shlex.split(" ".join(changes("robot", setup)))
    assert configured("robot=planar2", *typed, experiment="excite").robot.setup == setup
