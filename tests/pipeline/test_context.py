"""What a context's artifacts depend on, and the arm, home and clearance that its settings lead to."""

from dataclasses import replace
from functools import cache

import pytest

from sidegan.pipeline.context import RunContext
from sidegan.pipeline.stages import stage
from sidegan.pipeline.stages.baselines import long_family
from sidegan.pipeline.stages.replication import regression_sums, replication
from sidegan.pipeline.stages.seeds import seed_set
from sidegan.pipeline.stages.selection import whole_sets
from sidegan.pipeline.store import Store
from tests.tiny import tiny


@pytest.fixture(scope="module")
def stamps(tmp_path_factory):
    """Digest of every artifact of a configuration, by its title."""
    store = Store(tmp_path_factory.mktemp("store"))

    @cache
    def made(*overrides):
        context = RunContext(tiny(*overrides), store)
        artifacts = (artifact for name in context.cfg.stages for artifact in stage(name).artifacts(context))
        return {artifact.title: artifact.digest for artifact in artifacts}

    return made


def of(*variants, makers=("gan", "library", "measures", "selection", "identification", "plant")):
    alone = {variant: f"{variant}-alone" for variant in variants if variant in (*LEARNING, "exact")}
    picked = {
        f"{m}/{name}" for m in makers if m in ("selection", "identification") for name in alone.values()
    }
    return picked | {f"{maker}/{variant}" for maker in makers for variant in variants}


LEARNING = ("vanilla", "eigen", "diagonal", "prediction")  # from seeds
SETS = ("long-3", "long-12", "random", "seeds", "exact", *LEARNING)
IDENTIFICATIONS, PLANTS = (of(*SETS, makers=[maker]) for maker in ("identification", "plant"))
LONG = {"long/3", "long/12"} | of("long-3", "long-12", makers=["identification", "plant"])
BASELINES = ("natural", "search-10", "search-40", "search-160")
MEASURES = of("seeds", "random", "exact", *BASELINES, *LEARNING, makers=["measures"])
UNSEEDED = {
    "gan/exact",
    "library/exact",
    "selection/exact-alone",
    "identification/exact-alone",
    "random",
    *BASELINES,
}
UNSEEDED |= of("random", makers=["selection", "identification", "plant"])


EVERYTHING = ["seed=1", "robot=kuka_lwr4", "trajectory.period=9", "trajectory.home=[0.1, 0]"]
EVERYTHING += ["workspace.torque=false", "workspace.regions=[{sphere: {centre: [2, 0, 0], radius: 0.1}}]"]


@pytest.mark.parametrize(
    ("override", "expected"),
    [
        ("gan.eigen.weights.fitness=7", of("eigen")),
        ("gan.diagonal.steps=3", of("diagonal")),
        ("gan.generator.width=32", of(*LEARNING, "exact")),
        ("gan.vanilla.epochs=3", of("vanilla")),
        ("surrogates.epochs=3", {"surrogates"} | of("eigen", "diagonal", "prediction")),
        ("long.steps=6", LONG),
        ("identification.noise.level=0.2", IDENTIFICATIONS | MEASURES),
        ("identification.constant=0.02", IDENTIFICATIONS | MEASURES),
        ("identification.repeats=3", IDENTIFICATIONS),
        ("identification.reach=0.6", IDENTIFICATIONS | PLANTS | MEASURES),
        ("subset=20", {"surrogates"} | of(*LEARNING)),
        # Long trajectories have the seeds' optimiser, but steps of their own.
        ("seeds.steps=21", lambda every: every - UNSEEDED - LONG),
        ("seeds.count=41", lambda every: every - UNSEEDED - LONG),
        ("seeds.reserve=0.1", lambda every: every - UNSEEDED),
        *((override, set) for override in EVERYTHING),
    ],
)
def test_a_setting_changes_the_stamps_of_its_dependents_only(stamps, override, expected):
    before, after = stamps("gan=all"), stamps("gan=all", override)
    changed = {key for key in before if before[key] != after.get(key)}
    assert changed == (expected(before.keys()) if callable(expected) else expected)


IRRELEVANT = ["parallel.workers=2", "tracking=local", "outputs=elsewhere"]
IRRELEVANT += ["robot.gains=[1,1]", "workspace.clearance=0", "condition.name=other"]


def test_irrelevant_settings_change_no_stamp(stamps):
    assert stamps(*IRRELEVANT) == stamps()


def test_stamps_are_unique_and_shared_across_variants_and_trainings(stamps):
    made, eigen, three = stamps("gan=all"), stamps("gan=eigen"), stamps("gan=all", "trainings=[0,1,2]")
    assert len(set(made.values())) == len(made)
    assert {*eigen.values()} <= {*made.values()} <= {*three.values()}
    assert len({three[f"gan/eigen-{k}"] for k in range(3)}) == 3


def test_readings_share_measurements(context):
    """The seeds' measurements are as noisy in the reading of seeds as where all are."""
    made, names = context(experiment="exp2"), ("all", "seeds", "torques", "seeds_states")
    digests = ([regression_sums(made, pool, name).digest for pool in whole_sets(made)] for name in names)
    both, seeds, torques, states = digests
    assert both[0] == seeds[0] == states[0] and both[1] != seeds[1]
    assert not {*torques} & {*both} and states[1:] == torques[1:]
    assert len({replication(made, name).digest for name in names}) == 4


PART = "robot.limits.position={shoulder: [0.5, 1.5]}"


def test_home_is_given_or_chosen(context):
    given = context("trajectory.home=[0.1, 0.2]")
    assert given.cell.trajectory.shape == (2, 3, 2) and given.cell.trajectory.home == (0.1, 0.2)
    long = long_family(given, 12)
    assert (long.shape, long.period, long.home) == ((2, 12, 2), 32, (0.1, 0.2))
    found = context(PART)
    assert found.cell.trajectory.home == pytest.approx((1, 0), abs=1e-3) and context().cell.home == (0, 0)
    same = context(PART, f"trajectory.home={list(found.cell.home)}")
    assert seed_set(found).digest == seed_set(same).digest != seed_set(context()).digest


def test_a_clearance_is_part_of_the_stamp(context):
    none, some, more = (context(f"workspace.clearance={x}") for x in (0, 0.02, 0.03))
    stamps = [made.cfg.workspace.stamped(made.cell.arm) for made in (none, some)]
    assert "clearance" not in stamps[0] and stamps[1]["clearance"] == 0.02
    assert len({seed_set(made).digest for made in (none, some, more)}) == 3
    assert some.cell.constraints.clearance == 0.02
    assert context(experiment="excite").cell.constraints.clearance == 0.02
    assert context("workspace.clearance=0", experiment="excite").cell.constraints.clearance == 0


@pytest.mark.parametrize(("room", "kept"), [(0.031, 0.02), (0.016, 0.01), (0.012, 0.005), (0.001, 0.0)])
def test_the_default_clearance_leaves_home_room_to_move(context, caplog, room, kept):
    ball = f"workspace.regions=[{{sphere: {{centre: [{0.15 + room}, 0, 0.85], radius: 0.1}}}}]"
    rest = ["workspace.clearance=null", "trajectory.home=[0.0, 0.0]", ball]
    made = context(*rest)
    assert (made.cell.constraints.clearance, made.cell.constraints.apart) == (kept, 0.02)
    with caplog.at_level("INFO"):
        made.log_decisions()
    assert f"kept clear: {kept:g} m" in caplog.text
    assert made.cfg.workspace.stamped(made.cell.arm)["clearance"] is None
    assert context(*rest, "workspace.clearance=0.0").cell.constraints.clearance == 0


@pytest.mark.parametrize("chosen", ["robot=planar2", "robot.name=x.urdf", "++robot.name=x.urdf"])
def test_another_arm_of_a_comparison_is_its_own(context, chosen):
    run = replace(context(), overrides=("+experiment=generality", chosen, "robot.effort=0.5"))
    other = run.with_changes("robot=kuka_lwr4").cfg.robot
    assert (other.name, other.effort) == ("kuka_lwr4", 0.5)
