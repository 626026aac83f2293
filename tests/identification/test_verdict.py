"""Where a verdict changes: numbers just inside and just outside of what counts as good and as usable."""

import re
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


def uncertain(*shares):
    return {"torque_deviation": torch.tensor(shares, dtype=torch.float64)}


def at_deviations(name, deviations):
    """A parameter below zero by so many of its deviations."""

    def change(estimate):
        parameters, k = estimate.parameters.clone(), estimate.names.index(name)
        parameters[k] = -deviations * estimate.deviation[k]
        return replace(estimate, parameters=parameters)

    return change


LEAVES = r"^joint 2 \(elbow\): the model leaves 5%"
UNKNOWN = r"^joint 1 \(shoulder\): not identifiable.*uncertain by "
TIMES, NOMINAL = "times that of training", "the description's own link parameters predict as well"
DRIVES, ROTOR = r"^joint 2 \(elbow\).*friction drives no joint", "^joint 2.*a rotor has no negative inertia"
# What is changed, the verdict, and a reason that is given for it; a reason after "no" is not.
BOUNDARIES = [
    (errors(0.0199, 0.0199), GOOD, ""),
    (errors(0.0201, 0.0201), USABLE, ""),
    (errors(0.0999, 0.0999), USABLE, ""),
    (errors(0.1001, 0.1001), BAD, ""),
    (errors(0.0389, 0.0), GOOD, ""),
    (errors(0.0, 0.0499), USABLE, "no " + LEAVES),
    (errors(0.0, 0.0501), USABLE, LEAVES),
    (errors(0.0, 0.199), USABLE, ""),
    (errors(0.0, 0.301), BAD, ""),
    (uncertain(0.099, 0.0), GOOD, "no " + UNKNOWN),
    (uncertain(0.101, 0.0), USABLE, UNKNOWN + "10%"),
    (uncertain(0.499, 0.0), USABLE, UNKNOWN + "50%"),
    (uncertain(0.51, 0.0), BAD, UNKNOWN + "51%"),
    (uncertain(9.9, 0.0), BAD, UNKNOWN + "990%"),
    (uncertain(10.0, 0.0), BAD, UNKNOWN + "more than 1000%"),
    (errors(0.015, 0.015, train=1 / 2.9), GOOD, "no " + TIMES),
    (errors(0.015, 0.015, train=1 / 3.1), USABLE, "3.1 " + TIMES),
    (errors(0.0099, 0.0099, train=1e-3), GOOD, ""),  # both are good
    ({"nominal_score": score_of(0.011, 0.011)}, GOOD, "no " + NOMINAL),
    ({"nominal_score": score_of(0.009, 0.009)}, USABLE, NOMINAL),
    ({"estimate": lambda x: replace(x, condition=99.0)}, GOOD, "no condition number"),
    ({"estimate": lambda x: replace(x, condition=101.0)}, USABLE, "condition number 101"),
    ({"estimate": at_deviations("fv2", 1.9)}, GOOD, "no " + DRIVES),
    ({"estimate": at_deviations("fv2", 2.1)}, USABLE, DRIVES),
    ({"estimate": at_deviations("Ia2", 1.9)}, GOOD, "no " + ROTOR),
    ({"estimate": at_deviations("Ia2", 2.1)}, USABLE, ROTOR),
    ({"estimate": at_deviations("fo2", 5.0)}, GOOD, ""),  # an offset may be negative
    ({"mass": (19.9, 2.0)}, GOOD, "no the links weigh"),
    ({"mass": (20.1, 2.0)}, USABLE, "the links weigh .*2 kg"),
    ({"mass": (0.201, 2.0)}, GOOD, "no the links weigh"),
    ({"mass": (0.199, 2.0)}, USABLE, "the links weigh .*2 kg"),
]


@pytest.mark.parametrize(("changes", "verdict", "reason"), BOUNDARIES)
def test_a_verdict_changes_where_it_should(flawless, changes, verdict, reason):
    values = {name: x(getattr(flawless, name)) if callable(x) else x for name, x in changes.items()}
    result, words = replace(flawless, **values), reason.removeprefix("no ")
    assert result.verdict == verdict
    assert any(re.search(words, one) for one in result.reasons) == (words == reason)


SMALL = [(0.24, 0.26, "goes further"), (0.26, 0.24, "is faster")]


@pytest.mark.parametrize(("moved", "fast", "words"), SMALL)
def test_advice_is_about_what_was_small(flawless, moved, fast, words):
    arm, reach = flawless.arm, flawless.estimate.reach
    lower, span = arm.position_lower, arm.position_upper - arm.position_lower
    reach = reach._replace(lowest=lower, highest=lower + moved * span, fastest=fast * arm.velocity_limit)
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
