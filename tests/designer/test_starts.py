"""The library of starts: the same for a seed, on disk and back, and what is not one is refused."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from sidegan.designer import Designer, Situation, Starts, make_starts
from sidegan.designer.scene import ArmNumbers
from sidegan.errors import ArtifactError, InfeasibleError
from sidegan.motion.trajectory import Trajectory
from sidegan.validity import Box, Constraints

from .conftest import HOME


@pytest.fixture(scope="module")
def file(tmp_path_factory, starts, designer):
    path = tmp_path_factory.mktemp("starts") / "starts.pt"
    starts.save(path, designer.numbers)
    return path


def test_a_seed_gives_the_same_starts(workspace, settings, starts):
    again = make_starts(*workspace, settings, np.random.SeedSequence(0))
    other = make_starts(*workspace, settings, np.random.SeedSequence(1))
    np.testing.assert_array_equal(again.coefficients, starts.coefficients)
    np.testing.assert_array_equal(again.felt, starts.felt)
    assert np.abs(other.coefficients - starts.coefficients).max() > 0.01


def test_a_file_brings_them_back(file, starts, designer):
    loaded = Starts.load(file, designer.numbers)
    for name in ("home", "felt", "effort", "coefficients", "goal"):
        np.testing.assert_array_equal(getattr(loaded, name), getattr(starts, name))


def test_a_file_of_another_arm_or_of_something_else_is_refused(file, designer, planar, tmp_path):
    with pytest.raises(ArtifactError, match="holds starts of"):
        Starts.load(file, ArmNumbers(Constraints(planar), Trajectory(2)))
    with pytest.raises(ArtifactError, match="holds starts of"):
        Starts.load(file, ArmNumbers(designer.numbers.constraints, Trajectory(7, 5)))
    torch.save({"meta": "{}"}, tmp_path / "other.pt")
    with pytest.raises(ArtifactError, match="holds starts of"):
        Starts.load(tmp_path / "other.pt", designer.numbers)
    torch.save({"meta": "no JSON"}, tmp_path / "other.pt")
    with pytest.raises(ArtifactError, match="does not hold starts"):
        Starts.load(tmp_path / "other.pt", designer.numbers)
    content = torch.load(file, weights_only=True)
    torch.save({name: x for name, x in content.items() if name != "goal"}, tmp_path / "less.pt")
    with pytest.raises(ArtifactError, match="does not hold starts: it has"):
        Starts.load(tmp_path / "less.pt", designer.numbers)
    (tmp_path / "cut.pt").write_bytes(file.read_bytes()[:1000])
    with pytest.raises(ArtifactError):
        Starts.load(tmp_path / "cut.pt", designer.numbers)


def test_a_start_is_nearest_to_its_own_situation(starts, designer):
    own = designer.numbers.constraints.regions
    for index in range(len(starts)):
        velocity, torque, period = np.exp(starts.effort[index])
        situation = Situation(starts.home[index].tolist(), (), velocity, torque, period)
        felt = starts.felt[index]
        assert felt.shape == designer.probes.feel(own).shape
        equally_good = replace(starts, goal=np.zeros(len(starts)))
        assert equally_good.nearest(designer.numbers.scene(situation), felt, 1)[0] == index


def test_an_adapted_start_keeps_the_limits(starts, designer):
    scene = designer.numbers.scene(Situation(HOME, velocity=0.4, period=30.0))
    for index in range(len(starts)):
        c = starts.adapted(designer.numbers, scene, index)
        assert designer.numbers.use(scene, c).max() <= 0.97 + 1e-9


def test_regions_are_felt_where_they_are(designer):
    far, near = Box((5, 5, 5), (6, 6, 6)), Box((-9, -9, -9), (9, 9, 9))
    nothing = designer.probes.feel(())
    np.testing.assert_array_equal(designer.probes.feel((far,)), nothing)
    assert (designer.probes.feel((near,)) < nothing).all()


def test_an_arm_that_can_hardly_rest_anywhere_is_told_so(arm, settings):
    everywhere = Constraints(arm, [Box((-0.3, -0.3, 0.35), (0.3, 0.3, 2.0))])
    with pytest.raises(InfeasibleError, match="let it rest"):
        make_starts(everywhere, Trajectory(7), settings, np.random.SeedSequence(0))


def test_starts_help(workspace, settings, starts):
    with_starts, without = (
        Designer(*workspace, settings, library).ask(evaluations=12) for library in (starts, None)
    )
    assert with_starts.criteria.condition < without.criteria.condition
