"""The generator of starts: it learns, keeps limits, is the same for a seed and on disk and back."""

from dataclasses import replace

import numpy as np
import pytest
import torch
import yaml

from sidegan.base.typed import build
from sidegan.designer import Aim, Designer, Generator, GeneratorSettings, Situation, make_generator
from sidegan.designer.descent import Penalties
from sidegan.designer.designer import descents_of
from sidegan.designer.generator import features
from sidegan.designer.scene import ArmNumbers
from sidegan.designer.starts import Probes
from sidegan.designer.training import Mover
from sidegan.errors import ArtifactError, InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints, Plane

from .conftest import BOX, CONF, DESK, HOME

SEED = np.random.SeedSequence(0)
FEW = {"modes": 3, "width": 32, "depth": 1, "situations": 24, "batch": 16, "steps": 150}


@pytest.fixture(scope="module")
def few():
    path = CONF.parents[1] / "generator" / "default.yaml"
    return build(GeneratorSettings, {**yaml.safe_load(path.read_text(encoding="utf-8")), **FEW})


@pytest.fixture(scope="module")
def made(workspace, settings, few):
    return make_generator(*workspace, settings, few, SEED)


@pytest.fixture(scope="module")
def numbers(workspace):
    return ArmNumbers(*workspace)


def costs(numbers, settings, generator):
    """Penalised goals of its trajectories in situations that it has not seen."""
    descents, probes, found = descents_of(numbers, settings), Probes(numbers), []
    own, random = numbers.constraints.regions, np.random.default_rng(1)
    for regions in [(), (BOX,), (Plane((0, 0, 1), 0.2),), (Box((-0.6, -0.6, 0.3), (-0.4, -0.4, 0.6)),)] * 2:
        home = random.uniform(-0.4, 0.4, 7).tolist()
        scene = numbers.scene(Situation(home, regions, 0.7, 0.8, 20.0))
        descent = descents.descent(scene, Aim(), Penalties(30.0, 0.05, 0.05, 0.03))
        for c in generator.candidates(numbers, scene, probes.feel((*own, *regions)), 3):
            found.append(sum(descent.evaluate(numbers.points(scene, c), np.zeros_like(scene.size))))
    return np.array(found)


def test_it_learns(workspace, settings, few, made, numbers):
    untrained = make_generator(*workspace, settings, replace(few, steps=1), SEED)
    before, after = (costs(numbers, settings, one) for one in (untrained, made))
    assert np.median(after) < np.median(before) - 0.2 and after.mean() < before.mean()


def test_a_seed_gives_the_same(workspace, settings, few, made):
    brief = replace(few, steps=5)
    one, two, other = (
        make_generator(*workspace, settings, brief, np.random.SeedSequence(k)) for k in (3, 3, 4)
    )
    np.testing.assert_array_equal(one.modes, two.modes)
    np.testing.assert_array_equal(one.layers[-1][0], two.layers[-1][0])
    assert np.abs(one.modes - other.modes).max() > 0.01
    assert len(made) == 3 and made.modes.shape == (3, 84)


def test_what_it_gives_keeps_the_limits(numbers, made):
    scene = numbers.scene(Situation(HOME, [BOX], 0.4, 0.8, 30.0))
    felt = Probes(numbers).feel((DESK, BOX))
    candidates = made.candidates(numbers, scene, felt, 10)
    assert len(candidates) == 3
    for c in candidates:
        assert numbers.use(scene, c).max() <= 0.97 + 1e-9


def test_a_frozen_one_is_the_network(numbers):
    torch.manual_seed(0)
    mover = Mover(np.random.default_rng(0).standard_normal((4, 84)), 74, 16, 2)
    with torch.no_grad():
        for one in mover.parameters():
            one.add_(0.1 * torch.randn_like(one))
    order = np.array([2, 0, 3, 1])
    seen = np.random.default_rng(1).standard_normal(74)
    frozen = mover.frozen(order).points(seen, np.array([0, 3]))
    both = torch.from_numpy(seen).float().expand(2, -1)
    expected = mover(both, torch.tensor([2, 1])).detach().double().numpy()
    np.testing.assert_allclose(frozen, expected, atol=1e-4)


def test_it_sees_the_situation(numbers):
    probes = Probes(numbers)
    plain = numbers.scene(Situation())
    one = features(numbers, plain, probes.feel((DESK,)))
    assert np.abs(one[7:10]).max() < 1e-12 and np.abs(one).max() <= 1 + 1e-9
    other = numbers.scene(Situation(HOME, [BOX], 0.5, 0.5, 8.0))
    assert (features(numbers, other, probes.feel((DESK, BOX)))[7:10] < -1).all()


def test_a_file_brings_it_back(numbers, made, planar, tmp_path):
    made.save(tmp_path / "one.pt", numbers)
    loaded = Generator.load(tmp_path / "one.pt", numbers)
    np.testing.assert_array_equal(loaded.modes, made.modes)
    for one, other in zip(loaded.layers, made.layers, strict=True):
        np.testing.assert_array_equal(one[0], other[0])
        np.testing.assert_array_equal(one[1], other[1])
    with pytest.raises(ArtifactError, match="holds a generator of"):
        Generator.load(tmp_path / "one.pt", ArmNumbers(Constraints(planar), Trajectory(2)))
    torch.save({"meta": "{}"}, tmp_path / "other.pt")
    with pytest.raises(ArtifactError, match="holds a generator of"):
        Generator.load(tmp_path / "other.pt", numbers)
    short, fewer = made.modes[:, :10].copy(), made.modes[:2].copy()  # the network knows three
    for modes in (short, fewer):
        Generator(modes, made.layers).save(tmp_path / "wrong.pt", numbers)
        with pytest.raises(ArtifactError, match="contradicts itself"):
            Generator.load(tmp_path / "wrong.pt", numbers)


def test_a_designer_starts_from_it(workspace, settings, made):
    by_it, by_chance = Designer(*workspace, settings, made), Designer(*workspace, settings)
    for situation in (Situation(), Situation(velocity=0.5), Situation([0.1] * 7)):
        begun, other = (one.ask(situation, evaluations=12) for one in (by_it, by_chance))
        assert begun.criteria.condition < other.criteria.condition


def test_an_arm_that_can_rest_nowhere_is_told_so(arm, settings, few, monkeypatch):
    monkeypatch.setattr("sidegan.designer.training._TRIES", 20)
    everywhere = Constraints(arm, [Box((-0.3, -0.3, 0.35), (0.3, 0.3, 2.0))])
    with pytest.raises(InfeasibleError, match="none lets kuka_lwr4 rest"):
        make_generator(everywhere, Trajectory(7), settings, few, SEED)


def test_it_is_trained_in_plain_torch_as_well(plain, few):
    own, settings = plain.numbers, plain.settings
    brief = replace(few, modes=2, situations=3, batch=2, steps=2)
    made = make_generator(own.constraints, own.trajectory, settings, brief, SEED)
    assert made.modes.shape == (2, 12) and np.isfinite(made.modes).all()
