"""Identification from checked recordings: errors, the model to use, and the verdict with its thresholds."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from sidegan.errors import RecordingError
from sidegan.identification import EstimationSettings, Terms, estimate, thresholds
from sidegan.identification.estimate import Score, score
from sidegan.identification.identified import CONSISTENT, measurements_of
from sidegan.identification.verdict import BAD, GOOD, USABLE, Finding
from sidegan.identification.workflow import assess, cross_validate, identify_arm, recommended_method
from sidegan.report.identification import Origin, write_results
from sidegan.report.identification.content import advice
from tests.identification.recordings import (
    checked,
    half_still,
    identified,
    judged,
    model_of,
    recorded,
    white,
)
from tests.oracle import python_class
from tests.refusals import refused

NOISE = 0.3


@pytest.fixture(scope="module")
def good(planar):
    """A model, its estimate from a good recording, that, and another recording."""
    model = model_of(planar)
    data = recorded(model, 2000, NOISE)
    return model, estimate("weighted", model, data), data, recorded(model, 1000, NOISE, seed=1)


class TestScore:
    def test_is_nmse_and_rmse(self, good):
        model, found, _, data = good
        square = np.square(data.torque - model.torque(found.parameters, *data.states)).mean(0)
        result = score(model, found.parameters, [data[:300], data[300:]])
        np.testing.assert_allclose(result.nmse, square / data.torque.var(0))
        np.testing.assert_allclose(result.rmse, np.sqrt(square))

    def test_cross_validation_leaves_one_recording_out(self, good):
        model, *_ = good
        recordings = [recorded(model, 300, NOISE, seed) for seed in range(3)]
        each = []
        for k, held_out in enumerate(recordings):
            parameters = estimate("weighted", model, recordings[:k] + recordings[k + 1 :]).parameters
            each.append(score(model, parameters, held_out).nmse)
        found = cross_validate("weighted", model, [[recording] for recording in recordings])
        np.testing.assert_allclose(found.nmse, each)
        np.testing.assert_allclose(found.pooled.nmse, np.mean(each, 0))


def test_an_arm_at_rest_identifies_nothing(good):
    model, *_, data = good
    still = replace(data, velocity=0 * data.velocity, acceleration=0 * data.acceleration)
    result = judged(model, estimate("ols", model, still), still)
    assert result.verdict == BAD and any("some parameters have no effect" in x for x in result.reasons)


def test_a_joint_that_hardly_moves_is_not_identifiable(planar):
    result = judged(*half_still(planar, NOISE, 1e-3))
    (reason,) = (x for x in result.reasons if x.startswith("joint 2 (elbow)"))
    assert result.verdict == BAD and "not identifiable" in reason and "fv2" in reason


# Where a verdict changes: numbers just inside and just outside of what counts as good and as usable.
def score_of(*nmse):
    return Score(np.array(nmse), np.ones(len(nmse)))


@pytest.fixture(scope="module")
def flawless(good):
    """A good model of the planar arm, in which everything may be replaced."""
    model, found, data, validation = good
    result = judged(model, found, data, [validation])
    small = np.full(2, 0.01)
    errors = {"train": score_of(0.01, 0.01), "held_out": score_of(0.01, 0.01)}
    planted = replace(result, **errors, nominal_score=score_of(1.0, 1.0), torque_deviation=small, weak=())
    assert planted.verdict == GOOD
    return planted


def errors(*nmse, train=1.0):
    return {"held_out": score_of(*nmse), "train": score_of(*(train * x for x in nmse))}


def folded(*means):
    """Errors of recordings by the others."""
    return {"folds": Score(np.array([[x, x] for x in means]), np.ones((len(means), 2)))}


def uncertain(*shares):
    return {"torque_deviation": np.array(shares)}


def below_zero(name):
    """A parameter below zero by so many of its deviations."""

    def change(deviations):
        def changed(estimate):
            parameters, k = estimate.parameters.copy(), estimate.names.index(name)
            parameters[k] = -deviations * estimate.deviation[k]
            return replace(estimate, parameters=parameters)

        return {"estimate": changed}

    return change


def judged_with(flawless, changes):
    values = {name: x(getattr(flawless, name)) if callable(x) else x for name, x in changes.items()}
    return replace(flawless, **values)


# What is a hundredth below and above a number, the verdicts, and what is named above it alone. One of five
# parameters is below zero by 2.6 deviations as rarely as a single one by two.
BOUNDARIES = [
    (lambda x: errors(x, x), thresholds.GOOD_NMSE, GOOD, USABLE, "mean nMSE is 0.02"),
    (lambda x: errors(x, x), thresholds.USABLE_NMSE, USABLE, BAD, "mean nMSE is 0.1"),
    (lambda x: errors(0.0, x), thresholds.GOOD_JOINT_NMSE, USABLE, USABLE, "(elbow): the model leaves 5%"),
    (lambda x: uncertain(x, 0.0), thresholds.GOOD_UNCERTAINTY, GOOD, USABLE, "uncertain by 10%"),
    (lambda x: uncertain(x, 0.0), thresholds.USABLE_UNCERTAINTY, USABLE, BAD, ""),
    (lambda x: uncertain(x, 0.0), 10.0, BAD, BAD, "more than 1000%"),
    (lambda x: errors(0.015, 0.015, train=1 / x), thresholds.OVERFITTED, GOOD, USABLE, "times that of"),
    (lambda x: folded(0.01, x), 0.03, GOOD, USABLE, "recording 2"),  # their mean is then 0.02
    (lambda x: {"estimate": lambda e: replace(e, condition=x)}, 100.0, GOOD, USABLE, "condition number 101"),
    (below_zero("fv2"), 2.6, GOOD, USABLE, "(elbow): fv2"),
    (below_zero("Ia2"), 2.6, GOOD, USABLE, "(elbow): Ia2"),
]


@pytest.mark.parametrize(("changes", "threshold", "below", "above", "name"), BOUNDARIES)
def test_the_verdict_changes_at_its_thresholds(flawless, changes, threshold, below, above, name):
    for factor, verdict in ((0.99, below), (1.01, above)):
        result = judged_with(flawless, changes(factor * threshold))
        assert result.verdict == verdict
        assert not name or any(name in reason for reason in result.reasons) == (factor > 1)


SAID = [  # what is changed, the verdict, and what a reason names
    ({"held_out": None}, USABLE, "no recording was held out"),
    ({"where": "each recording by the others"}, GOOD, "0.0100 on each recording by the others"),
    ({"causes": (Finding(BAD, "gravity acts along +z"),)}, BAD, "gravity acts"),
    ({"causes": (Finding(USABLE, "weighs 99 kg", 1),)}, USABLE, "joint 2 (elbow): weighs 99 kg"),
    ({"causes": (Finding(GOOD, "velocities are derived"),)}, GOOD, "velocities are derived"),
    (errors(0.0099, 0.0099, train=1e-3), GOOD, "mean nMSE"),  # both are good
    (below_zero("fo2")(5.0), GOOD, "mean nMSE"),  # an offset may be negative
]


@pytest.mark.parametrize(("changes", "verdict", "name"), SAID)
def test_a_verdict_has_its_reason(flawless, changes, verdict, name):
    result = judged_with(flawless, changes)
    assert result.verdict == verdict and any(name in reason for reason in result.reasons)


def test_what_is_within_a_tenth_predicts_as_well(flawless):
    assert flawless.as_good(score_of(0.012, 0.0099)) and not flawless.as_good(score_of(0.012, 0.0101))


def test_what_leads_is_said_first_whatever_the_verdict(flawless):
    plain, leading = Finding(GOOD, "derived"), Finding(GOOD, "a load explains it", leads=True)
    for changes in ({}, errors(0.04, 0.04)):
        first, *_, last = replace(flawless, causes=(plain, leading), **changes).reasons
        assert first == leading.text and (last == plain.text or not changes)


def test_each_joint_has_one_reason_the_gravest_first(flawless):
    shaken = np.array([0.2, 0.2])
    weak = {"torque_deviation": shaken, "weak": ("fv1", "fc2", "Ia2")}
    result = replace(flawless, **errors(0.04, 0.31), **weak)
    first, second = (reason for reason in result.reasons if reason.startswith("joint "))
    assert first.startswith("joint 2") and second.startswith("joint 1") and result.verdict == BAD
    assert all(word in first for word in ("leaves 31%", "uncertain by 20% (fc2, Ia2)"))
    assert "uncertain by 20% (fv1)" in second and "leaves" not in second


@pytest.fixture(scope="module")
def recordings(planar):
    return [checked(planar, seed) for seed in range(3)]


@pytest.mark.parametrize("method", ["weighted", "ols"])
def test_every_method_identifies(planar, recordings, method):
    result = identified(planar, recordings[:1], recordings[1:2], method)
    assert result.chosen.method == method and result.kind == "held out"
    assert list(result.tested) == list(dict.fromkeys([method, "ols", "consistent"]))
    assert result.tested[method].nmse.mean() < 5e-3
    assert result.use == CONSISTENT
    assert result.links.shape == (2, 10)


def test_without_validation_recordings_are_cross_validated(planar, recordings):
    result = identified(planar, recordings)
    assert result.kind == "each of 3 recordings, predicted from the others"
    assert result.tested["weighted"].nmse.mean() < 2e-3
    assert result.quality.held_out is result.tested["consistent"]
    assert result.quality.folds is not None


def test_a_single_recording_is_tested_in_sample_and_says_so(planar, recordings):
    result = identified(planar, recordings[:1])
    assert result.tested["weighted"].nmse.mean() < 2e-3
    assert result.kind.startswith("in sample") and result.tested is result.trained
    assert any("held out" in reason for reason in result.quality.reasons)
    assert result.use == CONSISTENT and "nothing was held out to compare" in advice(result)


def test_fewer_equations_than_parameters_are_refused(planar, recordings):
    segment = recordings[0].segments[0]
    short = replace(recordings[0], segments=[type(segment)(*(x[:2] for x in segment))])
    with refused(RecordingError, "2 samples of 2 joints"):
        identified(planar, [short])


def test_the_consistent_model_is_preferred_unless_clearly_worse():
    errors = np.array([0.1, 0.01, 1e-3])
    one_joint = np.array([1.25, 0.95, 0.95])  # decides the mean, and nothing else
    for factor, use in ((1.09, CONSISTENT), (1.11, "weighted"), (one_joint, CONSISTENT)):
        tested = {"weighted": Score(errors, errors), CONSISTENT: Score(factor * errors, errors)}
        assert recommended_method("weighted", tested) == use


def test_the_weighted_model_is_used_if_it_predicts_better(planar, tmp_path):
    """The true arm's second link has a moment of inertia below zero, as unmodelled effects may look."""
    links = planar.inertial_parameters.copy()
    links[1, 4:] *= -2
    strange = [checked(planar, seed, replace(planar, inertial_parameters=links)) for seed in (0, 1)]
    result = identified(planar, strange[:1], strange[1:])
    errors = {method: score.nmse_mean for method, score in result.tested.items()}
    assert result.use == "weighted" and errors["weighted"] < errors[CONSISTENT] / 1.1
    assert f"{errors[CONSISTENT]:.4f}" in advice(result)
    assert result.quality.judged is result.tested["weighted"]
    used, weighted = result.used_standard, result.estimates["weighted"].parameters
    np.testing.assert_allclose(result.model.mapping @ used, weighted)
    assert not np.allclose(used, result.standard)
    write_results(result, Origin("", "", {}), tmp_path)
    states = white((3, 20, 2), 1)
    torque = result.model.torque(weighted, *states)
    np.testing.assert_allclose(python_class(tmp_path).torque(*states), torque, rtol=0, atol=1e-9)  # N·m
    assert "Method: weighted" in (tmp_path / "arm.h").read_text()
    mujoco.MjModel.from_xml_path(str(tmp_path / "planar2.xml"))  # of the consistent one: it exists


def test_a_description_is_compared_with_all_rotors_fitted(good):
    """That of the first joint, too, which is a part of another parameter."""
    model, *_ = good
    data = recorded(model, 1000)
    assert "Ia1" not in model.names
    assert assess(model, estimate("weighted", model, data), [data])["nominal_score"].nmse.max() < 1e-9


@pytest.mark.parametrize("kinds", [("viscous",), ("viscous", "coulomb")])
def test_friction_for_a_file_is_the_best_beside_the_links(planar, recordings, kinds):
    """By the residuals' slopes: none along what the file holds, unless friction is at zero."""
    result = identified(planar, recordings[:1])
    model, drives, samples = result.model, result.drives(*kinds), measurements_of(result.training)
    held = vars(drives)
    parameters = result.links.ravel() @ model.mapping[:, : 10 * model.joints].T
    for kind in kinds:
        parameters = parameters + model.mapping[:, model.standard_slice(kind)] @ held[kind]
    assert not any(x.any() for kind, x in held.items() if kind not in kinds)
    slope, size = 0.0, 0.0
    for part in samples:
        y = model.regressor(*part.inputs)
        slope = slope + np.einsum("sjp,sj->p", y, part.torque - model.torque(parameters, *part.inputs))
        size = size + np.einsum("sjp,sj->p", np.abs(y), np.abs(part.torque))
    for kind in kinds:
        columns = model.mapping[:, model.standard_slice(kind)]
        assert (held[kind] > 0).all() and (np.abs(columns.T @ slope) < 1e-9 * (columns.T @ size)).all()


def test_a_model_of_rigid_bodies_alone_is_identified(planar):
    """It has no terms to fit beside the description's links."""
    parts = [checked(planar, seed, friction=(0.0, 0.0)) for seed in (0, 1)]
    plain = Terms(viscous=False, coulomb=False, offset=False)
    found = identify_arm(planar, parts[:1], parts[1:], plain, EstimationSettings())
    assert found.quality.verdict == GOOD and found.model.kinds == ()
    assert not any(x.any() for x in vars(found.drives("viscous", "coulomb")).values())  # as files have them


def test_a_gantry_agrees_with_its_description(planar):
    """Its links act like rotors and offsets, so that torques say nothing of the description."""
    gantry = replace(planar, prismatic=np.array([True, True]), axis=np.eye(3)[:2])
    parts = [checked(gantry, seed) for seed in (0, 1)]
    assert identified(gantry, parts[:1], parts[1:]).quality.verdict == GOOD


def test_links_without_a_mass_are_no_load_that_differs(planar):
    """A description without inertias says nothing that could differ."""
    empty = replace(planar, inertial_parameters=0 * planar.inertial_parameters)
    parts = [checked(empty, seed, planar) for seed in (0, 1)]
    reasons = identified(empty, parts[:1], parts[1:]).quality.reasons
    assert not any("is the tool in it" in reason for reason in reasons)
