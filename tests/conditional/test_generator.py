from dataclasses import replace

import pytest
import torch

from sidegan.base.storage import read_torch, write_torch
from sidegan.conditional import ConditionalGenerator
from sidegan.conditional.settings import Cube, Request
from sidegan.conditional.space import ConditionSpace
from sidegan.conditional.study import outcome, validity
from sidegan.conditional.training import train
from sidegan.errors import ArtifactError, ConfigError, InfeasibleError, ShapeError, SideganError
from sidegan.gan.terms import Formula
from sidegan.validity import Constraints, Plane
from tests.conditional.conftest import NOTHING, RANGES, random
from tests.tiny import tiny

SIZES = {"epochs": 2, "steps": 2, "batch": 16, "noise": 12, "width": 32, "samples": 16, "evaluation": 3}
SMALL = replace(tiny(experiment="conditional").conditional.training, **SIZES)


@pytest.fixture(scope="module")
def trained(space, tmp_path_factory):
    return train(space, SMALL, tmp_path_factory.mktemp("work"), 0)


@pytest.fixture(scope="module")
def generator(trained):
    return trained.generator


@pytest.fixture
def file(generator, tmp_path):
    generator.save(tmp_path / "generator.pt")
    return tmp_path / "generator.pt"


def test_samples_come_with_the_family_that_was_asked_for(generator, space):
    condition = space.condition(Request(home=[0.2, -0.1], period=12.0, velocity=0.5))
    family, c = generator.sample(6, condition, 3)
    assert (family.period, family.home) == (12.0, (0.2, -0.1))
    assert c.shape == (6, 2, 3, 2) and c.dtype == torch.float64
    found = validity(generator, condition, c)
    assert float(found.margins["velocity"].min()) >= 0 and float(found.margins["position"].min()) >= 0


def test_the_same_seed_gives_the_same_trajectories(generator, space):
    condition = space.condition(Request(plane=0.2))
    first, second, other = (generator.sample(4, condition, seed)[1] for seed in (1, 1, 2))
    torch.testing.assert_close(first, second, rtol=0, atol=0)
    assert (first - other).abs().max() > 1e-3


def test_settled_samples_meet_whatever_is_asked(generator, conditions):
    found = outcome(generator, conditions, 4, random())
    assert found.summary()["success"] >= 0.97
    assert found.valid.shape == found.condition_number.shape == (12, 4)


def test_a_generator_survives_its_file(generator, file, constraints, space):
    loaded = ConditionalGenerator.load(file, constraints)
    assert loaded.space.ranges == RANGES and loaded.space.trajectory == space.trajectory
    condition = space.condition(Request(torque=0.6))
    again, c = (x.sample(3, condition)[1] for x in (loaded, generator))
    torch.testing.assert_close(again, c, rtol=0, atol=0)


def test_another_arm_or_workspace_is_refused(file, arm, planar):
    with pytest.raises(ArtifactError, match="trained for planar2"):
        ConditionalGenerator.load(file, Constraints(arm))
    with pytest.raises(ArtifactError, match="trained for the workspace"):
        ConditionalGenerator.load(file, Constraints(planar, [Plane((0, 0, 1), 0.2)]))


def test_a_damaged_or_foreign_file_is_refused(file, constraints):
    write_torch(file.with_name("foreign.pt"), {"weights": torch.zeros(2)})
    write_torch(file.with_name("list.pt"), [1])
    content = read_torch(file)
    write_torch(file.with_name("old.pt"), {**content, "meta": content["meta"].replace("conditional 1", "x")})
    file.with_name("cut.pt").write_bytes(file.read_bytes()[:300])
    write_torch(file.with_name("nan.pt"), {**content, "reach": content["reach"] * torch.nan})
    write_torch(file.with_name("flat.pt"), {**content, "spread": content["spread"] * 0})
    for name in ("foreign.pt", "list.pt", "old.pt", "cut.pt", "nan.pt", "flat.pt"):
        with pytest.raises(ArtifactError):
            ConditionalGenerator.load(file.with_name(name), constraints)


def test_what_cannot_be_sampled_is_refused(generator, space):
    with pytest.raises(ShapeError, match="cannot sample 0"):
        generator.sample(0)
    with pytest.raises(ConfigError, match="trained for"):
        generator.sample(1, space.condition(Request(period=100.0)))
    with pytest.raises(InfeasibleError, match="home violates obstacle"):
        generator.sample(1, space.condition(Request(obstacle=Cube((0.0, 0.0, 1.2), 0.1))))


def test_history_tells_how_well_conditions_are_met(trained):
    assert len(trained.history) == 2
    assert {"success", "condition", "worst_success", "distance", "seconds"} <= set(trained.history[0])


def test_an_interrupted_training_goes_on(space, tmp_path, trained):
    def stop(epoch, metrics):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        train(space, SMALL, tmp_path, 0, epoch_end=stop)
    epochs = []
    whole = train(space, SMALL, tmp_path, 0, epoch_end=lambda epoch, metrics: epochs.append(epoch))
    assert epochs == [1] and len(whole.history) == 2
    assert whole.history[0]["condition"] == pytest.approx(trained.history[0]["condition"], rel=1e-6)


def test_training_makes_valid_exciting_trajectories(space, tmp_path):
    longer = replace(SMALL, epochs=1, steps=40, batch=32, evaluation=12, learning_rate=5e-3)
    first = train(space, replace(longer, steps=1), tmp_path / "first", 0).history[0]
    last = train(space, longer, tmp_path / "last", 0).history[-1]
    assert last["success"] > first["success"] + 0.1


def test_a_dedicated_generator_serves_its_condition(space, tmp_path):
    only = space.condition(Request(velocity=0.5, walls=[0.6, 1.0]))
    made = train(space, SMALL, tmp_path, 0, only).generator
    assert made.sample(4, only)[1].shape == (4, 2, 3, 2)


def test_a_training_that_diverges_is_stopped_and_its_last_epoch_kept(space, tmp_path, monkeypatch):
    def spoil(epoch, metrics):
        nan = lambda self, batch: batch.coefficients.sum() * torch.nan  # noqa: E731
        monkeypatch.setattr(Formula, "forward", nan)

    with pytest.raises(SideganError, match="conditional diverged in epoch 1: the loss is nan; the last"):
        train(space, SMALL, tmp_path, 0, epoch_end=spoil)
    monkeypatch.undo()
    epochs = []
    train(space, SMALL, tmp_path, 0, epoch_end=lambda epoch, _: epochs.append(epoch))
    assert epochs == [1]


def test_trainings_that_make_no_sense_are_refused(space, constraints, family, tmp_path):
    with pytest.raises(ConfigError, match="batch is 16, expected a multiple of together=5"):
        replace(SMALL, together=5)
    nothing = replace(RANGES, **NOTHING)
    with pytest.raises(ConfigError, match="nothing may be asked for"):
        train(ConditionSpace(constraints, family, nothing), SMALL, tmp_path, 0)
    with pytest.raises(ConfigError, match="period is"):
        train(space, SMALL, tmp_path, 0, space.condition(Request(period=99.0)))
    assert not list(tmp_path.iterdir())
