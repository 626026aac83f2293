"""What stages compute themselves, beside what they have rooms for."""

import time
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pandas as pd
import pinocchio
import pytest
import torch

from sidegan.base.storage import read_json
from sidegan.pipeline.graph import Build
from sidegan.pipeline.stages import density, elsewhere, first_set, narrow, polish, timing, transfer
from sidegan.pipeline.store import Store
from sidegan.pipeline.task import REPORT, RESULTS, Task
from tests.tiny import tiny


@pytest.fixture
def task(tmp_path):
    def made(experiment, *overrides):
        return Task(tiny(f"outputs={tmp_path}", *overrides, experiment=experiment), Store(tmp_path))

    return made


def test_a_payload_has_the_inertia_of_a_ball_in_the_hand():
    mass, centre = 1.7, torch.tensor([0.1, -0.2, 0.4], dtype=torch.float64)
    inertia = mass * transfer._BALL**2 * np.eye(3)
    wanted = pinocchio.Inertia(mass, centre.numpy(), inertia).toDynamicParameters()
    torch.testing.assert_close(transfer._ball(mass, centre), torch.from_numpy(wanted), rtol=0, atol=1e-12)


def test_a_transfer_and_what_it_is_compared_with_train_for_their_share_of_the_epochs(task):
    made = task("beyond", "beyond.epochs=40", "beyond.share=0.25", "beyond.epoch=7")
    epochs = {way: transfer.schedule(made, way).epochs for way in transfer.WAYS}
    assert epochs == {transfer.SCRATCH: 40, transfer.BRIEF: 10, transfer.TRANSFER: 10}
    assert {transfer.schedule(made, way).steps for way in transfer.WAYS} == {7}
    least = made.with_settings(beyond=replace(made.cfg.beyond, share=1e-9))
    assert transfer.schedule(least, transfer.TRANSFER).epochs == 1


def test_a_transfer_tells_every_epoch_that_is_over(task, tmp_path, monkeypatch):
    made, told = task("beyond", "beyond.epochs=3"), []
    nothing = SimpleNamespace(generator=SimpleNamespace(save=lambda path: None), history=[], epoch=0)

    def trained(variant, *room):
        *_, run = room
        for epoch in range(variant.epochs):
            run.epoch_end(epoch, {})
        return nothing

    monkeypatch.setattr("sidegan.gan.training.train_variant", trained)
    build = Build(tmp_path, tmp_path, lambda *progress: told.append(progress))
    name, target = next(iter(made.cfg.beyond.targets.items()))
    transfer._make(made, build, target, name, transfer.SCRATCH)
    assert told == [(1, 3), (2, 3), (3, 3)]


def test_time_that_is_slept_is_no_cost():
    assert first_set._seconds(lambda: time.sleep(0.3)) < 0.1

    def busy():
        began = time.process_time()
        while time.process_time() - began < 0.2:
            pass

    assert 0.2 <= first_set._seconds(busy) < 0.4


def test_a_rate_is_that_of_all_but_the_first(monkeypatch):
    clock = SimpleNamespace(now=0.0)

    def work():
        clock.now += 0.125 if clock.now else 60.0  # the first one compiles
        return 7

    monkeypatch.setattr(timing, "time", SimpleNamespace(perf_counter=lambda: clock.now))
    assert timing._rate(work) == pytest.approx(7 / 0.125)


def test_the_narrower_a_density_estimate_the_nearer_its_samples_are_to_the_seeds(task, tmp_path, monkeypatch):
    made = task("reproduction", "discussion.bandwidths=[1e-6,1]", "discussion.draws=20")
    c = made.problem.start(40, torch.Generator().manual_seed(1), 0.5)
    monkeypatch.setattr(density, "training_seeds", lambda task: SimpleNamespace(coefficients=c))
    density._make(made, SimpleNamespace(folder=tmp_path))
    narrow, wide = pd.read_parquet(tmp_path / RESULTS).from_seed / torch.pdist(c.flatten(1)).min().item()
    assert narrow < 1e-4 and 0.1 < wide < 10


def test_a_blurred_seed_costs_the_time_of_all_draws_over_the_valid_ones(task, tmp_path, monkeypatch):
    made = task("beyond")
    c = made.problem.start(40, torch.Generator().manual_seed(1), 0.5)
    monkeypatch.setattr(narrow, "training_seeds", lambda task: SimpleNamespace(coefficients=c))
    monkeypatch.setattr(narrow, "time", SimpleNamespace(process_time=iter([5.0, 17.0]).__next__))
    build = SimpleNamespace(folder=tmp_path, costs={}, report=None)
    narrow._make(made, build)
    told = read_json(tmp_path / REPORT)
    assert build.costs["each"] * told["valid_share"] * told["drawn"] == pytest.approx(12.0)


def test_a_training_takes_as_long_as_its_steps_and_what_it_begins_with(task, monkeypatch):
    made = task("beyond")
    name = next(name for name, variant in made.cfg.gan.items() if not variant.seeded)
    variant = replace(made.cfg.gan[name], epochs=6, steps=50)
    made = made.with_settings(gan={name: variant})
    monkeypatch.setattr(first_set, "_seconds", lambda work: 3.0 + 0.5 * work.args[0])
    assert first_set._training_seconds(made, name) == pytest.approx(3.0 + 0.5 * 6 * 50)


def test_moves_rest_where_trajectories_pass_and_keep_their_share_of_the_limits(task):
    fast = "identification.rate=500"
    made = task("reproduction", "elsewhere.moves=3", "elsewhere.rest=0.5", "elsewhere.velocity=0.6", fast)
    c = made.problem.start(4, torch.Generator().manual_seed(1), 0.8)
    motion = elsewhere.moves(made, c, 0)
    position, velocity = motion.position[0], motion.velocity[0]
    still = (velocity == 0).all(1)
    stops = int((still[1:] & ~still[:-1]).sum()) + int(still[0])
    assert stops == 4  # between three moves, before the first and after the last
    rate = made.cfg.identification.rate
    assert int(still.sum()) >= 4 * round(0.5 * rate) and float(motion.time[1]) == pytest.approx(1 / rate)
    share = (velocity.abs() / made.arm.velocity_limit).amax()
    assert 0.4 < float(share) <= 0.6 + 1e-12
    passed = made.trajectory.roll_out(c, made.trajectory.grid(20_000)).position.reshape(-1, made.arm.joints)
    assert float(torch.cdist(position[still], passed).amin(1).max()) < 1e-2
    other = elsewhere.moves(made, c, 1).position[0]
    assert other.shape != position.shape or not torch.equal(other, position)


def test_the_cost_of_polishing_is_that_of_one_trajectory(task):
    made = task("beyond")
    c = made.problem.start(4, torch.Generator().manual_seed(1), 0.5)
    row = polish._row(made, "exact", 3, c, 10.0)
    assert (row["start"], row["steps"], row["seconds"]) == ("exact", 3, 2.5) and row["condition"] > 1
    alone = polish._row(made, "exact", 3, c[:1], 10.0)
    assert np.isnan(alone["seconds"]) and np.isnan(alone["condition"])
    assert np.isfinite(polish._row(made, "exact", 3, c[:2], 10.0)["condition"])
