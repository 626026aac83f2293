"""Readings of the paper's noise, and tests unlike what models are identified from."""

import pytest
import torch

from sidegan.base.storage import write_torch
from sidegan.errors import ConfigError
from sidegan.identification.sums import Sums
from sidegan.pipeline.stages.elsewhere import FAST, MOVES, RANDOM, SLOW, kinds_of_test
from sidegan.pipeline.stages.random import REACH, random_valid
from sidegan.pipeline.stages.readings import covariance, readings
from sidegan.pipeline.stages.replication import SUMS, Measured, draws, replication, sums, whole_sets
from sidegan.pipeline.store import Store, write_stamp
from sidegan.pipeline.task import Task
from tests.tiny import tiny


def task(root, *overrides):
    return Task(tiny(f"outputs={root}", *overrides, experiment="reproduction"), Store(root))


@pytest.fixture
def tasks(tmp_path):
    """The tiny task under each reading."""
    return readings(task(tmp_path))


def digests(one):
    return {(pool.name, pool.training or 0): sums(one, pool).digest for pool in whole_sets(one)}


def test_readings_share_what_is_equal_and_nothing_else(tasks):
    everything, replications, torques = (digests(tasks[x]) for x in ("everything", "replications", "torques"))
    seeds = ("seeds", 0)
    assert everything[seeds] == replications[seeds] != torques[seeds]
    for key in set(everything) - {seeds}:
        assert len({everything[key], replications[key], torques[key]}) == 3
    assert len({replication(one).digest for one in tasks.values()}) == 3


def test_what_differs_lies_in_folders_of_other_names(tasks):
    made = [sums(one, pool) for one in tasks.values() for pool in whole_sets(one)]
    made += [replication(one) for one in tasks.values()]
    named = {(one.maker, one.label): one.digest for one in made}
    assert len(named) == len({one.digest for one in made})
    assert not any("everything" in label for _, label in named)


def test_the_own_reading_names_no_reading(tasks):
    """Its artifacts are those of a run that knows of no other reading."""
    own = tasks["everything"]
    assert replication(own).label == "planar2-vanilla-eigen-diagonal-seed0"
    assert {sums(own, pool).label.rpartition("-seed0")[0] for pool in whole_sets(own)} == {
        f"planar2-{name}" for name in ("seeds", "vanilla", "eigen", "diagonal")
    }
    assert replication(own).title == "nmse" and replication(tasks["torques"]).title == "nmse/torques"


def test_what_is_exact_is_measured_once(tmp_path):
    under = readings(task(tmp_path, "readings.replications.repeats=3", "readings.torques.repeats=3"))
    for name, repeats in (("replications", 1), ("torques", 3)):
        seeds, *libraries = (Measured.of(under[name], pool) for pool in whole_sets(under[name]))
        assert (seeds.repeats, seeds.replicas) == (3, 10)
        assert {(one.repeats, one.replicas) for one in libraries} == {(repeats, 1)}


@pytest.mark.parametrize("name, held, taken", [("replications", 1, [0, 0, 0]), ("torques", 3, [0, 1, 2])])
def test_each_noise_draw_is_taken_once_and_what_is_exact_every_time(name, held, taken, tmp_path):
    one = readings(task(tmp_path, f"readings.{name}.repeats=3"))[name]
    pool = whole_sets(one)[1]
    artifact = sums(one, pool)
    folder = one.store.folder(artifact)
    folder.mkdir(parents=True)
    parts = {field: torch.zeros(1) for field in Sums._fields}
    write_torch(folder / SUMS, [[parts | {"weight": torch.tensor(k)}] for k in range(held)])
    write_stamp(folder, artifact.stamp)
    assert [int(part.weight) for (part,) in draws(one, pool)] == taken


def test_norms_follow_the_recursions_and_the_noise(tmp_path):
    usual = covariance(task(tmp_path))
    for change in ("recursions=[{prior:2,forgetting:1}]", "replication.noise.level=0.2"):
        assert covariance(task(tmp_path, change)).digest != usual.digest
    assert covariance(task(tmp_path, "readings.torques.noise.level=0.2")).digest == usual.digest


@pytest.mark.parametrize("change", ["readings.torques.reading=others", "replication.reading=torques"])
def test_readings_that_would_be_taken_for_each_other_are_refused(change, tmp_path):
    with pytest.raises(ConfigError, match=r"readings\.torques\.reading is"):
        task(tmp_path, change)


def test_kinds_of_test_use_as_much_of_the_limits_as_they_should(tmp_path):
    made = task(tmp_path)
    settings, count = made.cfg.elsewhere, made.cfg.identification.tests
    problem = made.problem
    for purpose, reach in (("slow tests", settings.slow * REACH), ("fast tests", settings.fast)):
        c = random_valid(made, count, purpose, reach).coefficients
        use = problem.limit_use(c)
        assert use.min() == pytest.approx(reach) and use.max() == pytest.approx(reach)
        assert made.check(c).valid.all()
    kinds = kinds_of_test(made)
    assert list(kinds) == [RANDOM, SLOW, FAST, MOVES] and {len(x) for x in kinds.values()} == {count}
    speed = {kind: torch.cat([x.velocity for x in parts]).abs().amax(0) for kind, parts in kinds.items()}
    assert (speed[SLOW] < speed[RANDOM]).all()
    share = torch.stack([x.velocity.abs().amax(0) for x in kinds[MOVES]]) / made.arm.velocity_limit
    assert share.max() <= settings.velocity + 1e-9 and share.amax(1).min() > 0.9 * settings.velocity
    for part in kinds[MOVES]:
        lower, upper = made.arm.position_lower, made.arm.position_upper
        assert (part.position >= lower).all() and (part.position <= upper).all()


def test_each_recording_of_pick_and_place_is_another(tmp_path):
    first, second, *_ = kinds_of_test(task(tmp_path))[MOVES]
    length = min(len(first), len(second))
    assert not torch.allclose(first.position[:length], second.position[:length])
