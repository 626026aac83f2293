import shlex
from functools import cache

import numpy as np
import pytest

from sidegan.errors import ConfigError, InfeasibleError
from sidegan.pipeline.stages.identification import identification
from sidegan.pipeline.stages.library import library
from sidegan.pipeline.stages.long import long_family, long_trajectory
from sidegan.pipeline.stages.optimised import optimised
from sidegan.pipeline.stages.pools import pools
from sidegan.pipeline.stages.random import random_set
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import excitation_sets, selection
from sidegan.pipeline.stages.training import generator, generators, surrogates
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import Task
from sidegan.robot import Limits, Setup, words
from sidegan.validity import Box, Plane
from tests.tiny import tiny


@pytest.fixture(scope="module")
def stamps(tmp_path_factory):
    """Digest of every artifact of a configuration."""
    store = Store(tmp_path_factory.mktemp("store"))

    @cache
    def made(*overrides):
        task = Task(tiny(*overrides), store)
        artifacts = {"seeds": seed_set(task), "random": random_set(task)}
        artifacts["surrogates"] = surrogates(task, "broad")
        for name, k in generators(task):
            artifacts[f"gan {name} {k}"] = generator(task, name, k)
            artifacts[f"library {name} {k}"] = library(task, name, k)
        for pool in pools(task):
            artifacts[f"selection {pool.name} {pool.training or 0}"] = selection(task, pool)
        for one in excitation_sets(task):
            artifacts[f"identification {one.name} {one.training or 0}"] = identification(task, one)
        artifacts |= {f"long {h}": long_trajectory(task, h) for h in task.cfg.long.harmonics}
        return {key: artifact.digest for key, artifact in artifacts.items()}

    return made


def changed(before, after):
    return {key for key in before if before[key] != after.get(key)}


def of(variant):
    return {f"{stage} {variant} 0" for stage in ("gan", "library", "selection", "identification")}


IDENTIFICATIONS = {
    f"identification {name} 0"
    for name in ("long-3", "long-12", "random", "seeds", "vanilla", "eigen", "diagonal")
}


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("gan.eigen.weights.fitness=7", of("eigen")),
        ("gan.diagonal.width=32", of("diagonal")),
        ("gan.vanilla.epochs=3", of("vanilla")),
        ("surrogates.epochs=3", {"surrogates"} | of("eigen") | of("diagonal")),
        ("long.steps=6", {"long 3", "long 12", "identification long-3 0", "identification long-12 0"}),
        ("identification.noise.level=0.2", IDENTIFICATIONS),
        ("identification.repeats=3", IDENTIFICATIONS),
        ("subset=20", {"surrogates"} | of("vanilla") | of("eigen") | of("diagonal")),
    ],
)
def test_a_setting_changes_what_depends_on_it_and_nothing_else(stamps, override, expected):
    assert changed(stamps(), stamps(override)) == expected


LONG = [("long", "3"), ("long", "12"), ("identification", "long-3 0"), ("identification", "long-12 0")]


@pytest.mark.parametrize(
    ("override", "optimiser"),
    [("seeds.steps=21", False), ("seeds.reserve=0.1", True), ("seeds.count=41", False)],
)
def test_the_seeds_change_everything_but_the_baseline(stamps, override, optimiser):
    baseline = {"random", "selection random 0", "identification random 0"}
    if not optimiser:  # which makes the long ones, too, with steps of their own
        baseline |= {f"{maker} {long}" for maker, long in LONG}
    assert changed(stamps(), stamps(override)) == set(stamps()) - baseline


@pytest.mark.parametrize(
    "override",
    [
        "seed=1",
        "robot=kuka_lwr4",
        "workspace.torque=false",
        "workspace.regions=[{plane: {normal: [0, 0, 1], offset: 0.1}}]",
        "workspace.regions=[{sphere: {centre: [2, 0, 0], radius: 0.1}}]",
        "trajectory.period=9",
        "trajectory.home=[0.1, 0]",
    ],
)
def test_the_arm_and_its_workspace_change_everything(stamps, override):
    before = stamps()
    assert changed(before, stamps(override)) == set(before)


def test_where_and_how_it_is_made_changes_nothing(stamps):
    elsewhere = ("parallel.workers=2", "parallel.threads=2", "tracking=local", "outputs=elsewhere")
    assert stamps(*elsewhere) == stamps()


def test_every_artifact_has_a_stamp_of_its_own(stamps):
    made = stamps()
    assert len(set(made.values())) == len(made)


def test_leaving_a_variant_out_keeps_the_others(stamps):
    both, one = stamps(), stamps("gan=eigen")
    assert {key for key in one if one[key] != both[key]} == set()


def test_another_training_shares_seeds_and_surrogates(stamps):
    one, three = stamps(), stamps("trainings=[0,1,2]")
    assert one.items() <= three.items()
    assert len({three[f"gan eigen {k}"] for k in range(3)}) == 3


def test_random_numbers_differ_by_purpose_and_seed(tmp_path):
    tasks = [Task(tiny(f"seed={seed}"), Store(tmp_path)) for seed in (0, 0, 1)]
    drawn = [task.random("seeds").generate_state(4).tolist() for task in tasks]
    assert drawn[0] == drawn[1] != drawn[2]
    assert tasks[0].number("gan eigen") == tasks[1].number("gan eigen") != tasks[2].number("gan eigen")
    purposes = ["seeds", "gan eigen", "gan diagonal", "tests", "labels 0", "labels 1"]
    assert len({tasks[0].number(purpose) for purpose in purposes}) == len(purposes)
    assert isinstance(tasks[0].random("x"), np.random.SeedSequence)


def test_regions_are_planes_and_boxes():
    workspace = tiny(
        "workspace.regions=[{plane: {normal: [0, 0, 1], offset: 0.1}}, "
        "{box: {lower: [0, 0, 0], upper: [1, 1, 1]}}]"
    ).workspace
    plane, box = (one.shape for one in workspace.regions)
    assert isinstance(plane, Plane) and plane.offset == 0.1
    assert isinstance(box, Box) and tuple(box.upper) == (1, 1, 1)


def test_an_impossible_home_is_refused_before_any_work(tmp_path):
    task = Task(tiny("trajectory.home=[0, 4]"), Store(tmp_path))
    with pytest.raises(InfeasibleError, match="position of elbow"):
        task.constraints  # noqa: B018
    task = Task(tiny("trajectory.home=[0, 90]"), Store(tmp_path))
    with pytest.raises(ConfigError, match="are these degrees"):
        task.constraints  # noqa: B018


def test_the_trajectories_are_the_arms(tmp_path):
    task = Task(tiny("trajectory.home=[0.1, 0.2]"), Store(tmp_path))
    assert task.trajectory.shape == (2, 3, 2) and task.trajectory.home == (0.1, 0.2)
    long = long_family(task, 12)
    assert long.shape == (2, 12, 2) and long.period == 32 and long.home == (0.1, 0.2)
    assert task.body is task.constraints.body


PART = (
    "robot.locked={elbow: 0.5}",
    "robot.limits.velocity={shoulder: 0.7}",
    "robot.limits.position={shoulder: [0.5, 1.5]}",
)


def test_what_is_said_beside_the_description_makes_another_arm(tmp_path):
    task = Task(tiny(*PART), Store(tmp_path))
    assert task.arm.joint_names == ("shoulder",)
    assert task.arm.velocity_limit.tolist() == [0.7]
    assert task.arm.digest != Task(tiny(), Store(tmp_path)).arm.digest


@pytest.mark.parametrize("name", ["elbow", "joint_8.0", "body_1/left-arm", "j 1", "7"])
def test_a_setup_survives_the_command_line(name):
    limits = Limits(position={name: (-1.5, 2.0)}, velocity={name: 0.25}, jerk={name: 1e3})
    setup = Setup(
        args={name: "0.5", "kind": "ur5e"},
        base="a b",
        tip=name,
        locked={name: -0.5},
        limits=limits,
        home="ready",
    )
    assert tiny(*map(unquoted, words(setup))).robot.setup == setup


def unquoted(word):
    """A word as the shell hands it over."""
    return shlex.split(word)[0]


def test_a_default_home_is_part_of_the_stamp_as_a_given_one_is(tmp_path):
    task = Task(tiny(PART[2]), Store(tmp_path))
    assert task.trajectory.home == pytest.approx((1, 0), abs=1e-3)
    given = Task(tiny(PART[2], f"trajectory.home={list(task.home)}"), Store(tmp_path))
    made, again, zeros = (seed_set(one).digest for one in (task, given, Task(tiny(), Store(tmp_path))))
    assert made == again != zeros
    assert Task(tiny(), Store(tmp_path)).home is None


def test_a_clearance_is_part_of_the_stamp_where_there_is_one(tmp_path):
    none = Task(tiny(), Store(tmp_path))
    same, some, more = (Task(tiny(f"workspace.clearance={x}"), Store(tmp_path)) for x in (0, 0.02, 0.03))
    stamps = [one.cfg.workspace.stamped(one.arm) for one in (none, some)]
    assert "clearance" not in stamps[0] and stamps[1]["clearance"] == 0.02
    assert seed_set(none).digest == seed_set(same).digest
    assert len({seed_set(one).digest for one in (none, some, more)}) == 3
    assert some.constraints.clearance == 0.02 and "0.02 m kept clear" in some.constraints.described()
    with pytest.raises(ConfigError, match="clearance"):
        tiny("workspace.clearance=-0.1")


@pytest.mark.parametrize(
    ("room", "kept", "apart"),
    [
        (0.03, 0.02, 0.02),
        (0.012, 0.01, 0.0),
        (0.001, 0.0, 0.0),
    ],
)
def test_as_much_as_home_has_room_for_is_kept_where_nobody_says_how_much(tmp_path, caplog, room, kept, apart):
    ball = f"workspace.regions=[{{sphere: {{centre: [{0.15 + room}, 0, 0.85], radius: 0.1}}}}]"
    rest = ["clearance=null", "trajectory.home=[0.0, 0.0]", ball]
    task = Task(tiny(*rest), Store(tmp_path))
    found = task.constraints
    assert (found.clearance, found.apart) == (kept, apart)
    with caplog.at_level("INFO"):
        task.tell_checks()
    assert f"kept clear: {kept:g} m" in caplog.text
    assert task.cfg.workspace.stamped(task.arm)["clearance"] is None
    assert Task(tiny(*rest, "workspace.clearance=0.0"), Store(tmp_path)).constraints.clearance == 0


def test_excite_keeps_clear_where_nobody_says_how_much(tmp_path):
    assert Task(tiny(experiment="excite"), Store(tmp_path)).constraints.clearance == 0.02
    none = tiny("workspace.clearance=0", experiment="excite")
    assert Task(none, Store(tmp_path)).constraints.clearance == 0


def test_a_named_home_is_the_one_of_the_srdf(tmp_path):
    path = tmp_path / "arm.srdf"
    pose = '<joint name="{}" value="{}"/>'
    words = pose.format("shoulder", 0.1) + pose.format("elbow", -0.2)
    path.write_text(
        f'<robot name="planar2"><group_state name="ready" group="arm">{words}</group_state></robot>'
    )
    named = (f"robot.srdf={path}", "robot.home=ready")
    assert Task(tiny(*named), Store(tmp_path)).trajectory.home == (0.1, -0.2)
    with pytest.raises(ConfigError, match="are two homes"):
        _ = Task(tiny(*named, "trajectory.home=[0, 0]"), Store(tmp_path)).arm


def test_how_many_seeds_are_enough_is_in_no_stamp(tmp_path):
    """Neither of the sets nor of long trajectories: it changes none of them."""
    digests = []
    for enough in ("null", "3"):
        task = Task(tiny(f"seeds.enough={enough}", experiment="beyond"), Store(tmp_path))
        digests.append([one.digest for one in (seed_set(task), optimised(task))])
        task = Task(tiny(f"seeds.enough={enough}", experiment="exp1"), Store(tmp_path))
        digests[-1].append(long_trajectory(task, 3).digest)
    assert digests[0] == digests[1] and len(set(digests[0])) == 3
