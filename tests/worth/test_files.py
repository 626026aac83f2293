"""Contenders that others made: libraries, and waypoints."""

import json
from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.errors import ConfigError, InfeasibleError
from sidegan.library.measure import measured
from sidegan.validity import check
from sidegan.worth import Contender, make_set
from sidegan.worth.orders import Order, file_of, seconds_of
from sidegan.worth.waypoints import Rests

PERIOD = 8.0  # [s]


@pytest.fixture
def ordered(task, place, tmp_path):
    """An order of a set of two from a file of the planar arm."""

    def make(maker, path, number=0, seed=0, **changes):
        files = {place.arm.name: str(path)}
        one = Contender(maker, "others", PERIOD, 3, 2 * PERIOD, files=files, **changes)
        home = (0.3, -0.2)
        return Order(place, home, task.cfg.worth, one, 2, np.random.SeedSequence(seed), number)

    return make


@pytest.fixture
def waypoints(tmp_path):
    random = np.random.default_rng(0)
    motions = [np.concatenate([np.zeros((1, 2)), 0.3 * random.standard_normal((3, 2)), np.zeros((1, 2))])]
    motions.append(2 * motions[0])
    made = [{"seconds": k + 1.0, "waypoints": x.tolist()} for k, x in enumerate(motions)]
    content = {"step": 2.0, "trajectories": made}
    path = tmp_path / "motions.json"
    path.write_text(json.dumps(content), encoding="utf-8")
    return path


def test_waypoints_are_one_motion_that_rests_in_each(ordered, waypoints):
    made = make_set(ordered("waypoints", waypoints, number=1))
    times = torch.linspace(0, PERIOD, 401, dtype=torch.float64)
    motion = made.family.roll_out(made.coefficients, times)
    torch.testing.assert_close(motion.position[0, ::100], made.coefficients[0].T)
    assert motion.velocity[0, ::100].abs().max() < 1e-12 and motion.velocity.abs().max() > 0.1
    step = float(times[1])
    for lower, higher in ((motion.position, motion.velocity), (motion.velocity, motion.acceleration)):
        slope = (lower[0, 2:] - lower[0, :-2]) / (2 * step)
        inner = torch.arange(1, 400) % 100 != 0  # the jerk jumps in the waypoints
        assert (slope - higher[0, 1:-1])[inner].abs().max() < 0.02 * higher.abs().max()
    other = make_set(ordered("waypoints", waypoints, number=0))
    torch.testing.assert_close(2 * other.coefficients, made.coefficients)
    assert seconds_of(waypoints) == 1.5


def test_violations_are_counted(place):
    points = torch.tensor([[[0.0, 0.2, 0.0], [0.0, -0.2, 0.0]]], dtype=torch.float64)
    slow, fast = Rests(8.0), Rests(0.2)
    assert max(slow.violations(place, points).values()) == 0
    broken = fast.violations(place, points)
    assert 0.2 < broken["velocity"] < 1 and broken["position"] == 0


@pytest.mark.parametrize(
    ("number", "period", "message"), [(2, PERIOD, "holds 2 motions"), (0, 12.0, "5 waypoints take no 12 s")]
)
def test_a_file_that_does_not_fit_is_refused(ordered, waypoints, number, period, message):
    one = ordered("waypoints", waypoints, number)
    one = replace(one, contender=replace(one.contender, period=period))
    with pytest.raises(ConfigError, match=message):
        make_set(one)


def test_an_arm_without_a_file_has_no_such_contender(ordered, waypoints):
    one = ordered("waypoints", waypoints).contender
    assert file_of(one, "another") is None and file_of(replace(one, files=None), "another") is None
    gone = replace(one, files={"another": "/nowhere/motions.json"})
    assert file_of(gone, "another") is None


def test_a_library_contends_with_what_is_valid_here(ordered, place, tmp_path):
    path, one = tmp_path / "library.parquet", ordered("library", tmp_path)
    family, random = one.family(), torch.Generator().manual_seed(0)
    drawn = torch.cat([one.problem().start(30, random, reach) for reach in (0.4, 1.5)])
    library = measured(place, family, drawn, "somebody")
    assert 4 < int(library.valid.sum()) < 60
    library.save(path)
    first, second = (make_set(ordered("library", path, seed=k)) for k in (0, 1))
    assert check(place, family, first.coefficients).valid.all()
    assert not torch.equal(first.coefficients, second.coefficients)
    distance = (first.coefficients[:, None] - drawn).flatten(2).norm(dim=2).amin(1)
    assert distance.max() < 1e-9  # they are the library's own
    with pytest.raises(ConfigError, match="has trajectories of"):
        make_set(replace(one, home=(0.0, 0.0), contender=ordered("library", path).contender))
    library.take(torch.nonzero(~library.valid)[:, 0]).save(path)
    with pytest.raises(InfeasibleError, match="hardly any"):
        make_set(ordered("library", path))
