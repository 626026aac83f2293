"""Effects on single joints: planted ones become terms, of noise and faults none do, and files hold them."""

from dataclasses import replace

import numpy as np
import pinocchio
import pytest

from sidegan.base.arrays import geometric_mean
from sidegan.errors import ConfigError
from sidegan.identification import TorqueModel, estimate, score
from sidegan.identification.effects import EFFECT_KINDS
from sidegan.identification.evidence import effects_of
from sidegan.identification.verdict import BAD, GOOD
from sidegan.report.identification import Origin, write_results
from sidegan.steps.excite import known_model
from tests.identification.recordings import (
    FRICTION,
    VISCOUS,
    checked,
    identified,
    measured,
    multisine,
    planted,
    truth_of,
    white,
)
from tests.oracle import pinocchio_torque, python_class
from tests.refusals import refused

NOISE = 0.5  # [N·m]
SIZE = 5 * NOISE  # of each form
ALIKE = 1.2  # largest ratio of errors to those of the model that made the torques


def recorded(model, parameters, seed, noise=NOISE):
    return measured(model, multisine(model.joints, 3000, seed), noise, seed, parameters)


PLANTED = {kind: ((1, kind),) for kind in EFFECT_KINDS} | {
    "three": ((0, "near_rest"), (1, "load"), (3, "position"))
}


@pytest.mark.parametrize("chosen", PLANTED.values(), ids=PLANTED)
def test_planted_effects_become_terms_that_predict_as_well_as_the_truth(model, chosen):
    true, parameters = planted(model, chosen, SIZE)
    data = [recorded(true, parameters, seed) for seed in (0, 1)]
    effects, each = effects_of(model, [[part] for part in data])
    assert [(effect.joint, effect.kind) for effect in each] == [*chosen]
    assert all(effect.error < 0.9 for effect in each)
    exact, models = (
        recorded(true, parameters, 2, 0.0),
        (TorqueModel(model.body, model.terms, effects), true, model),
    )
    ours, best, plain = (score(x, estimate("weighted", x, data).parameters, exact).nmse for x in models)
    assert geometric_mean(ours / best) < ALIKE
    assert all(ours[joint] < plain[joint] / 2 for joint, _ in chosen)


@pytest.mark.parametrize("parts", [1, 2])
def test_noise_gives_no_terms(model, parts):
    data = [[recorded(model, truth_of(model), seed)] for seed in range(parts)]
    assert effects_of(model, data) == (None, [])


def test_the_load_is_that_of_pinocchio(model, arm):
    """Friction that grows with the load, and a rotor's, in closed form."""
    true, parameters = planted(model, [(1, "load")], SIZE)
    q, dq, ddq = states = multisine(model.joints, 50, 3)
    robot = pinocchio.buildModelFromUrdf(str(arm.urdf))
    robot.armature = FRICTION["rotor_inertia"] * np.linspace(1.0, 0.4, model.joints)  # as in truth_of
    load = np.abs(pinocchio_torque(robot, *states))
    added = SIZE * np.tanh(dq / 0.01) * load / true.effects.usual
    plain = model.torque(parameters[: model.count], *states)
    np.testing.assert_allclose(true.torque(parameters, q, dq, ddq)[:, 1], (plain + added)[:, 1], atol=1e-8)


def test_wanted_effects_are_kept_and_unknown_joints_refused(model):
    data = [[recorded(model, truth_of(model), seed)] for seed in (0, 1)]
    _, each = effects_of(model, data, {model.arm.joint_names[2]: ["load", "direction", "load"]})
    assert [(effect.joint, effect.kind) for effect in each] == [(2, "direction"), (2, "load")]
    assert effects_of(model, data, {}) == (None, [])
    with refused(ConfigError, "wrist", model.arm.joint_names[0]):
        effects_of(model, data, {"wrist": ["load"]})


def stiff(made):
    """A recording of an arm with friction near rest in its elbow."""
    torque, v = made.torque.copy(), made.velocity[:, 1]
    torque[:, 1] += 2 * np.tanh(v / 0.01) * np.exp(-((v / 0.1) ** 2))
    return replace(made, torque=torque)


def without_coulomb(arm, seed, truth=None, change=None):
    """A recording whose Coulomb friction, of another width than the model's, looks like no effect."""
    return checked(arm, seed, truth, change, friction=(VISCOUS, 0.0), noise=0.002)


@pytest.fixture(scope="module")
def stuck(planar):
    """An arm with such a joint, identified with and without effects."""
    parts = [without_coulomb(planar, seed, change=stiff) for seed in range(3)]
    return [identified(planar, parts[:2], parts[2:], effects=effects) for effects in ("auto", "none")]


def test_identification_has_them_and_says_what_they_buy(stuck):
    with_them, without = stuck
    assert [(effect.joint, effect.kind) for effect in with_them.effects] == [(1, "near_rest")]
    assert with_them.modelled[0].startswith("joint 2 (elbow): the model has friction near rest")
    assert not without.effects and "friction near rest" in " ".join(without.left_over)
    assert with_them.quality.verdict == GOOD and with_them.quality.mean(with_them.quality.judged) < (
        without.quality.mean(without.quality.judged) / 2
    )


def test_files_hold_them(stuck, planar, tmp_path):
    """The Python class has the model's torques, and a design knows the arm by what it shares with others."""
    found, _ = stuck
    write_results(found, Origin("", "", {}), tmp_path)
    states = white((3, 20, 2), 1)
    torque = found.model.torque(found.used.parameters, *states)
    np.testing.assert_allclose(python_class(tmp_path).torque(*states), torque, atol=1e-9)
    known, covariance, *_ = known_model(tmp_path, planar)
    count = known.count
    assert count < found.model.count
    np.testing.assert_allclose(covariance, found.chosen.covariance[:count, :count])


def test_a_fault_is_not_explained_by_effects(planar, heavier):
    """A load in one recording alone."""
    parts = [without_coulomb(planar, seed, truth) for seed, truth in enumerate((heavier, None, None))]
    found = identified(planar, parts[:2], parts[2:])
    assert not found.effects and found.quality.verdict != GOOD


def test_effects_do_not_turn_a_bad_model_into_a_good_one(planar):
    """Most of the elbow's torque depends on its position in a way that the plain model does not have."""

    def strung(made):
        torque = made.torque.copy()
        torque[:, 1] += 3 * torque[:, 1].std() * np.sin(8 * made.position[:, 1])
        return replace(made, torque=torque)

    parts = [without_coulomb(planar, seed, change=strung) for seed in range(3)]
    plain, found = (identified(planar, parts[:2], parts[2:], effects=x) for x in ("none", "auto"))
    assert plain.quality.verdict == BAD and found.quality.verdict != GOOD
