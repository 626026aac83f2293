"""Where a verdict changes: numbers just inside and just outside of what counts as good and as usable."""

from dataclasses import replace

import pytest
import torch

from sidegan.identification import estimate, trust
from sidegan.identification.score import Score
from sidegan.identification.verdict import BAD, GOOD, USABLE
from tests.identification.recordings import model_of, recorded


def score_of(*nmse):
    return Score(torch.tensor(nmse, dtype=torch.float64), torch.ones(len(nmse), dtype=torch.float64))


@pytest.fixture(scope="module")
def flawless(planar):
    """A good model of the planar arm, in which everything may be replaced."""
    model = model_of(planar)
    data = recorded(model, 600, 0.01)
    result = trust(model, estimate("weighted", model, data), [recorded(model, 300, 0.01, seed=2)])
    small = torch.full((2,), 0.01, dtype=torch.float64)
    errors = {"train": score_of(0.01, 0.01), "validation": score_of(0.01, 0.01)}
    planted = replace(result, **errors, nominal_score=score_of(1.0, 1.0), torque_deviation=small, weak=())
    assert planted.verdict == GOOD
    return planted


def errors(*nmse, train=1.0):
    return {"validation": score_of(*nmse), "train": score_of(*(train * x for x in nmse))}


@pytest.mark.parametrize(
    ("nmse", "verdict"),
    [
        ((0.0199, 0.0199), GOOD),
        ((0.0201, 0.0201), USABLE),
        ((0.0999, 0.0999), USABLE),
        ((0.1001, 0.1001), BAD),
        ((0.0499 - 0.011, 0.0), GOOD),
        ((0.0002, 0.0501), USABLE),
        ((0.0, 0.199), USABLE),
        ((0.0, 0.301), BAD),
    ],
)
def test_errors_decide(flawless, nmse, verdict):
    assert replace(flawless, **errors(*nmse)).verdict == verdict


@pytest.mark.parametrize(("nmse", "told"), [(0.0499, False), (0.0501, True)])
def test_the_worst_joint_is_named(flawless, nmse, told):
    reasons = replace(flawless, **errors(0.0, nmse)).reasons
    assert any(x.startswith("joint 2 (elbow): the model leaves 5%") for x in reasons) == told


@pytest.mark.parametrize(
    ("share", "verdict", "words"),
    [
        (0.099, GOOD, None),
        (0.101, USABLE, "uncertain by 10%"),
        (0.499, USABLE, "uncertain by 50%"),
        (0.51, BAD, "uncertain by 51%"),
        (9.9, BAD, "uncertain by 990%"),
        (10.0, BAD, "uncertain by more than 1000%"),
        (1e9, BAD, "uncertain by more than 1000%"),
    ],
)
def test_uncertain_torque_decides(flawless, share, verdict, words):
    result = replace(flawless, torque_deviation=torch.tensor([share, 0.0], dtype=torch.float64))
    assert result.verdict == verdict
    said = [x for x in result.reasons if x.startswith("joint 1 (shoulder): not identifiable")]
    assert [words in x for x in said] == ([] if words is None else [True])


@pytest.mark.parametrize(("ratio", "told"), [(2.9, False), (3.1, True)])
def test_a_model_that_predicts_others_worse_than_its_own_is_overfitted(flawless, ratio, told):
    result = replace(flawless, **errors(0.015, 0.015, train=1 / ratio))
    assert any(f"{ratio:.1f} times that of training" in x for x in result.reasons) == told
    tiny = replace(flawless, **errors(0.0099, 0.0099, train=1e-3))
    assert tiny.verdict == GOOD  # both are good


@pytest.mark.parametrize(("nominal", "told"), [(0.011, False), (0.009, True)])
def test_a_description_that_predicts_as_well_is_told(flawless, nominal, told):
    reasons = replace(flawless, nominal_score=score_of(nominal, nominal)).reasons
    assert any("the description's own link parameters predict as well" in x for x in reasons) == told


@pytest.mark.parametrize(("condition", "told"), [(99.0, False), (101.0, True)])
def test_a_poor_condition_is_told(flawless, condition, told):
    result = replace(flawless, estimate=replace(flawless.estimate, condition=condition))
    assert any(f"condition number {condition:.0f}" in x for x in result.reasons) == told
    assert result.verdict == (USABLE if told else GOOD)


@pytest.mark.parametrize(
    ("moved", "fast", "words"), [(0.24, 0.26, "goes further"), (0.26, 0.24, "is faster")]
)
def test_advice_is_about_what_was_small(flawless, moved, fast, words):
    arm, reach = flawless.arm, flawless.estimate.reach
    span = arm.position_upper - arm.position_lower
    reach = reach._replace(
        lowest=arm.position_lower,
        highest=arm.position_lower + moved * span,
        fastest=fast * arm.velocity_limit,
    )
    shaken = torch.tensor([0.2, 0.0], dtype=torch.float64)
    found = replace(flawless.estimate, reach=reach)
    (reason,) = replace(flawless, estimate=found, torque_deviation=shaken).reasons
    assert reason.partition("with a motion that ")[2].startswith(words) and " and " not in reason


def test_all_about_a_joint_is_one_reason_and_the_gravest_comes_first(flawless):
    shaken = torch.tensor([0.2, 0.2], dtype=torch.float64)
    weak = {"torque_deviation": shaken, "weak": ("fv1", "fc2", "Ia2")}
    result = replace(flawless, **errors(0.04, 0.31), **weak)
    first, second = (reason for reason in result.reasons if reason.startswith("joint "))
    assert first.startswith("joint 2") and second.startswith("joint 1") and result.verdict == BAD
    assert all(word in first for word in ("leaves 31%", "uncertain by 20% (fc2, Ia2)", "excite it"))
    assert "uncertain by 20% (fv1)" in second and "leaves" not in second


@pytest.mark.parametrize(("deviations", "told"), [(1.9, False), (2.1, True)])
@pytest.mark.parametrize(
    ("name", "words"),
    [("fv2", "friction drives no joint"), ("Ia2", "a rotor has no negative inertia"), ("fo2", "")],
)
def test_what_no_joint_has_is_told(flawless, name, words, deviations, told):
    found = flawless.estimate
    parameters, k = found.parameters.clone(), found.names.index(name)
    parameters[k] = -deviations * found.deviation[k]
    result, told = (
        replace(flawless, estimate=replace(found, parameters=parameters)),
        told and bool(words),
    )
    assert result.verdict == (USABLE if told else GOOD)
    assert any(x.startswith("joint 2 (elbow)") and words in x for x in result.reasons) == told


@pytest.mark.parametrize(("found", "told"), [(19.9, False), (20.1, True), (0.201, False), (0.199, True)])
def test_links_of_another_weight_are_told(flawless, found, told):
    result = replace(flawless, mass=(found, 2.0))
    assert result.verdict == (USABLE if told else GOOD)
    assert ("the links weigh" in result.reasons[0] and "2 kg" in result.reasons[0]) == told
