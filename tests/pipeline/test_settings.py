import dataclasses
from pathlib import Path

import pytest
import yaml

from sidegan.errors import ConfigError
from sidegan.gan.variants import Weights
from sidegan.pipeline.graph import flatten
from sidegan.pipeline.run import CONF
from sidegan.pipeline.settings import Config, altered, validate
from tests import tiny


def composed(*overrides, experiment="reproduction"):
    return tiny.composed(f"+experiment={experiment}", *overrides)


def configured(*overrides, experiment="reproduction"):
    return validate(composed(*overrides, experiment=experiment))


def options(group):
    return sorted(path.stem for path in (CONF / group).glob("[!_]*.yaml"))


EXPERIMENTS = options("experiment")
COMPOSED = {name: composed(experiment=name).keys() for name in EXPERIMENTS}
OPTIONS = [
    (next(name for name in EXPERIMENTS if path.name in COMPOSED[name]), path.name, option)
    for path in sorted(CONF.iterdir())
    if path.is_dir() and path.name not in ("hydra", "experiment", "uses", "recorded", "varied")
    for option in options(path.name)
]


@pytest.mark.parametrize(("experiment", "group", "option"), OPTIONS)
def test_every_option_of_every_group_is_valid(experiment, group, option):
    assert isinstance(configured(f"{group}={option}", experiment=experiment), Config)


@pytest.mark.parametrize("experiment", options("experiment"))
@pytest.mark.parametrize("scale", options("scale"))
def test_every_experiment_is_valid_at_every_scale(experiment, scale):
    scaled = "scale" in COMPOSED[experiment]
    config = configured(*([f"scale={scale}"] if scaled else []), experiment=experiment)
    assert config.experiment == experiment
    assert config.stages
    assert not scaled or config.scale.name == scale


def test_a_command_composes_what_it_uses():
    config = configured("robot=ur10e", experiment="identify")
    assert not config.has("gan") and not config.has("seeds") and config.has("recording", "model")
    assert len(flatten(config.plain())) < 80
    with pytest.raises(ConfigError, match=r"no settings seeds: choose an experiment"):
        config.seeds.count  # noqa: B018
    assert (config.recording.cutoff, config.model.rotor_inertia) == (5, True)


def test_an_ablation_is_a_variant_with_changes():
    config = configured(experiment="ladder")
    eigen, cold = config.ladder["ours"], config.ablation["eigen_cold"]
    assert cold == dataclasses.replace(eigen, gaussian_start=False) != eigen
    undiverse = config.ablation["eigen_undiverse"].weights
    assert undiverse == dataclasses.replace(eigen.weights, spread=0, distance=0, rank=0)
    assert configured("scale=paper", experiment="ladder").ablation["eigen_conv"].epochs == 50
    with pytest.raises(ConfigError, match=r"ablation needs variants, and changes"):
        altered({"variants": {}, "changes": {"new": {"of": "eigen"}}}, "ablation")
    chain = {"one": {"of": "base", "a": {"x": 1}}, "two": {"of": "one", "b": 2}}
    assert altered({"variants": {"base": {"a": {"x": 0, "y": 0}}}, "changes": chain}, "ladder") == {
        "one": {"a": {"x": 1, "y": 0}},
        "two": {"a": {"x": 1, "y": 0}, "b": 2},
    }
    with pytest.raises(ConfigError, match=r"ablation\.eigen_conv\.width is 0, expected a whole number"):
        configured("ablation.changes.eigen_conv.width=0", experiment="ladder")


def test_the_paper_is_taken_to_the_letter():
    variants = configured("gan=paper", "scale=paper").gan
    vanilla, eigen, diagonal = variants.values()
    assert list(variants) == ["vanilla_paper", "eigen_paper", "diagonal_paper"]
    assert [one.features for one in variants.values()] == ["none", "spectrum", "diagonal"]
    assert dataclasses.replace(eigen, features="diagonal") == diagonal
    assert dataclasses.replace(eigen, features="none", weights=vanilla.weights) == vanilla
    assert eigen.weights == Weights(1, 1, 1, 1, 0, 0, 0)
    assert (eigen.epochs, eigen.fitness_start, eigen.batch, eigen.noise, eigen.generator_steps) == (
        *(50, 10, 100, 100),
        2,
    )
    assert (eigen.learning_rate, eigen.critic_rate, eigen.betas) == (2e-4, 2e-4, (0.5, 0.999))
    assert eigen.learned == {"predictor": "paper", "converter": "paper"}
    ours = (eigen.decay, eigen.gaussian_start, eigen.minibatch, eigen.gradient_penalty, eigen.average)
    assert ours == (False, False, False, 0, None)


def test_the_ladder_leads_from_the_paper_to_ours_one_change_at_a_time():
    config = configured("gan=[eigen,paper]", experiment="ladder")
    names = list(config.ladder)
    assert names[names.index("repaired") - 2 :][:3] == ["averaged", "ours", "repaired"]
    rungs = [config.ladder[name] for name in names[: names.index("repaired")]]
    repaired, less = config.ladder["repaired"], names[names.index("repaired") + 1 :]
    assert rungs[0] == config.gan["eigen_paper"]
    assert rungs[-1] == config.gan["eigen"]
    # What one step may be made of.
    together = {"rates": {"learning_rate", "critic_rate", "betas", "decay", "clip"}}
    together |= {"perceptron": {"body"}, "converter": {"surrogates", "real_features"}}
    together |= {"generator": {"width", "activation", "noise"}}
    for name, before, after in zip(list(config.ladder)[1:], rungs, rungs[1:]):
        fields = {one.name for one in dataclasses.fields(after)}
        different = {key for key in fields if getattr(before, key) != getattr(after, key)}
        assert different, name
        assert different == together.get(name, different) and (len(different) == 1 or name in together)
    kept = {"learning_rate", "betas", "gradient_penalty", "gaussian_start", "minibatch", "real_features"}
    assert all(getattr(repaired, name) == getattr(rungs[0], name) for name in kept)
    assert all(name.startswith("repaired_") and config.ladder[name] != repaired for name in less)
    assert dataclasses.replace(rungs[-2], least_valid=rungs[-1].least_valid) == rungs[-1]


def test_the_column_of_the_smallest_repair_is_the_ladders_last_rung():
    column = configured(experiment="reproduction").columns["repaired"]
    rung = configured("gan=[eigen,paper]", experiment="ladder").ladder["repaired"]
    assert column.gan["eigen"] == rung
    ours = configured("gan=all").gan["diagonal"].weights
    assert column.gan["diagonal"] == dataclasses.replace(rung, features="diagonal", weights=ours)
    vanilla = configured("gan=paper").gan["vanilla_paper"]
    assert column.gan["vanilla"] == dataclasses.replace(vanilla, body=rung.body, scaling=rung.scaling)
    assert column.surrogates.negatives == {"vanilla": column.gan["vanilla"]}


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
    own = ("features", "weights", "learning_rate", "activation", "width", "noise", "limited", "clip")
    shared = dataclasses.replace(vanilla, **{name: getattr(eigen, name) for name in own})
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


def test_the_papers_constraints_are_the_desk_without_torque_limits():
    desk, paper = configured().workspace, configured("seeds=paper", "workspace=paper").workspace
    assert desk.torque and not paper.torque
    assert paper == dataclasses.replace(desk, torque=False)


@pytest.mark.parametrize("fitness", ["eigenvalue", "diagonal"])
def test_the_papers_seeds_have_either_fitness_and_the_papers_number(fitness):
    config = configured("seeds=paper", "workspace=paper", "scale=paper", f"seeds.fitness={fitness}")
    assert config.seeds.count == 1800 and config.seeds.reserve is None
    assert config.seeds.optimiser.generations * config.seeds.optimiser.ants >= 10_000
    assert config.seeds.optimiser.evaluations >= 10_000


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
        (
            ["workspace.regions=[{}]"],
            "workspace.regions[0]: a region is one of plane, box, sphere, cylinder and mesh",
        ),
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


@pytest.mark.parametrize("value", ["null", "many", "[1]"])
def test_a_number_that_others_follow_from_is_refused_by_its_own_name(value):
    with pytest.raises(ConfigError, match=r"selection\.count is .*, expected a whole number"):
        configured(f"selection.count={value}", experiment="excite")


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
