import dataclasses
from pathlib import Path

import pytest
import yaml
from hydra import compose, initialize_config_dir

from sidegan.errors import ConfigError
from sidegan.pipeline import callbacks  # noqa: F401 - registers what the paths in conf/ use
from sidegan.pipeline.config import Config, validate
from sidegan.pipeline.run import CONF


def composed(*overrides):
    with initialize_config_dir(str(CONF), version_base="1.3"):
        return compose("config", overrides=list(overrides))


def configured(*overrides):
    return validate(composed(*overrides))


def options(group):
    return sorted(path.stem for path in (CONF / group).glob("[!_]*.yaml"))


GROUPS = [
    path.name for path in sorted(CONF.iterdir()) if path.is_dir() and path.name not in ("hydra", "experiment")
]


@pytest.mark.parametrize(
    ("group", "option"), [(group, option) for group in GROUPS for option in options(group)]
)
def test_every_option_of_every_group_is_valid(group, option):
    config = configured(f"{group}={option}")
    assert isinstance(config, Config)


@pytest.mark.parametrize("experiment", options("experiment"))
@pytest.mark.parametrize("scale", options("scale"))
def test_every_experiment_is_valid_at_every_scale(experiment, scale):
    config = configured(f"+experiment={experiment}", f"scale={scale}")
    assert config.experiment == experiment
    assert config.stages
    assert config.scale.name == scale


def test_the_scale_reaches_the_other_groups_whatever_their_choice():
    config = configured("scale=paper", "gan=eigen")
    assert list(config.gan) == ["eigen"]
    assert config.gan["eigen"].epochs == config.scale.gan_epochs == 50
    assert config.seeds.count == 1800
    assert config.library.count == 4200
    assert config.selection.count == 35


def test_the_variants_share_what_is_not_their_own():
    vanilla, eigen, diagonal = configured("gan=all").gan.values()
    assert [v.features for v in (vanilla, eigen, diagonal)] == ["none", "spectrum", "diagonal"]
    own = {"features": "spectrum", "weights": eigen.weights, "learning_rate": eigen.learning_rate}
    shared = dataclasses.replace(vanilla, **own)
    assert shared == eigen == dataclasses.replace(diagonal, features="spectrum", weights=eigen.weights)
    assert configured("gan=eigen").gan["eigen"] == eigen


def test_one_number_can_be_set_for_all_variants_or_for_one():
    everywhere = configured("scale.gan_epochs=30").gan
    assert {variant.epochs for variant in everywhere.values()} == {30}
    one = configured("gan.eigen.epochs=30").gan
    assert one["eigen"].epochs == 30 and one["vanilla"].epochs != 30


def test_a_robot_may_be_a_path_and_regions_may_be_boxes():
    config = configured(
        "robot.name=/some/where/arm.urdf",
        "workspace.regions=[{box: {lower: [0, 0, 0], upper: [1, 1, 1]}}]",
        "trajectory.home=[0, 0.5]",
    )
    assert config.robot.name == "/some/where/arm.urdf"
    assert config.workspace.regions[0].box.upper == (1.0, 1.0, 1.0)
    assert config.trajectory.home == [0.0, 0.5]


@pytest.mark.parametrize(
    ("overrides", "expected"),
    [
        (["+seeds.cuont=3"], "seeds.cuont: there is no such setting; did you mean seeds.count?"),
        (["seeds.count=many"], "seeds.count is 'many', expected a whole number ≥ 1"),
        (["seeds.method=adam"], "seeds.method is 'adam', expected one of gradient, paper"),
        (["tracking.enabled=perhaps"], "tracking.enabled is 'perhaps', expected true or false"),
        (["seed=???"], "seed: "),
        (["seeds.count=${scale.nothing}"], "seeds.count: "),
        (["seeds.method=paper"], "choose it by seeds=paper"),
        (["seeds=paper", "seeds.method=gradient"], "choose seeds=gradient"),
        (
            ["gan.vanilla.weights.fitness=1"],
            "gan.vanilla: weights.features and weights.fitness need features",
        ),
        (["gan.eigen.fitness_start=20", "gan.eigen.epochs=20"], "comes after the last of 20 epochs"),
        (["workspace.regions=[{}]"], "workspace.regions[0]: a region is either a plane or a box"),
        (["tracking.uri=htp://host"], "tracking: uri is 'htp://host'"),
        (["device=gpu"], "device is 'gpu', expected cpu, cuda, cuda:N or mps"),
        (["stages=[seeds,gan,seeds]"], "expected each stage once"),
        (["selection.count=10000"], "expected at most seeds.count + library.count"),
        (["seeds.samples=12"], "seeds.samples is 12, expected more than two per period"),
        (["long.samples=420"], "long.samples is 420, expected more than two per period"),
        (["identification.rate=0.5"], "identification.rate is 0.5 Hz, expected more than twice"),
    ],
)
def test_what_cannot_be_is_refused_by_name(overrides, expected):
    with pytest.raises(ConfigError) as error:
        configured(*overrides)
    assert expected in str(error.value)


@pytest.mark.parametrize(
    ("key", "value", "expected"),
    [("experiment", "../up", "'../up' names a folder"), ("gan", {}, "gan is empty")],
)
def test_what_an_experiment_file_may_get_wrong_is_refused_too(key, value, expected):
    cfg = composed()
    cfg[key] = value
    with pytest.raises(ConfigError, match=expected):
        validate(cfg)


@pytest.mark.parametrize(
    "uri", ["http://host:5000", "sqlite:///x.db", "postgresql+psycopg2://u@h/d", "databricks"]
)
def test_any_mlflow_server_can_be_named(uri):
    assert configured(f"tracking.uri='{uri}'").tracking.uri == uri


def test_conf_is_plain_yaml_without_structured_configs():
    files = list(Path(CONF).rglob("*.yaml"))
    assert files
    for path in files:
        content = yaml.safe_load(path.read_text(encoding="utf-8"))
        assert isinstance(content, dict), path
        assert "???" not in path.read_text(encoding="utf-8")
