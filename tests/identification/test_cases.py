"""Recordings that do not belong to their description: what the verdict says of each kind."""

import math
import re
from dataclasses import replace

import numpy as np
import pytest

from sidegan.identification.verdict import BAD, GOOD, USABLE, implausible_links, implausible_mass
from sidegan.motion.dynamics import RigidBody
from sidegan.recording.check import check_recording
from sidegan.report.identification.content import advice
from sidegan.robot import Setup, load_robot
from tests.identification.test_workflow import COULOMB, VISCOUS, identified
from tests.recording.conftest import moved, of_file

SIZE = 9.81


@pytest.fixture(scope="module")
def arm():
    return load_robot("kuka_lwr4")


def recordings(arm, change, truth=None):
    """One recording to identify from and another to test with, with what a change makes of the torques."""
    found, time = [], np.arange(15 * 100) / 100
    for seed in (2, 3):  # motions that excite every joint, so that verdicts are about what is changed
        generator = np.random.default_rng(seed)
        made = moved(truth or arm, time, VISCOUS[0], COULOMB[0], generator, period=6.0)
        found.append(check_recording(replace(made, torque=change(made)), arm, of_file()))
    return found


def judged(arm, change=lambda made: made.torque, truth=None):
    training, validation = recordings(arm, change, truth)
    return identified(arm, [training], [validation], strength=1.0)  # one conic program, not one a round


def pulled(arm, *direction):
    """The arm where gravity acts along another direction of its base."""
    return replace(arm, gravity=SIZE * np.array(direction))


def scaled(*factors):
    return lambda made: made.torque * factors


def without_gravity(arm):
    still = RigidBody(arm)
    return lambda made: made.torque - still.torque(made.position, 0 * made.position, 0 * made.position)


def test_a_good_recording_of_a_right_description_is_good(arm):
    result = judged(arm)
    assert result.quality.verdict == GOOD and "the description is right" in result.quality.reasons[0]


TILTED = (math.sqrt(0.5), 0.0, -math.sqrt(0.5))
TURNED = [
    ((0, 0, 1), "along +z of the base, by the description along −z", [math.pi, 0, 0]),
    ((1, 0, 0), "along +x of the base", [0, math.pi / 2, 0]),
    ((0, -1, 0), "along −y of the base", [math.pi / 2, 0, 0]),
    (TILTED, "along (0.71, 0.00, -0.71) of the base", [0, math.pi / 4, 0]),
]


@pytest.mark.parametrize(("direction", "words", "mount"), TURNED, ids=[words for _, words, _ in TURNED])
def test_gravity_along_another_direction_is_named_with_the_mount_that_mends_it(arm, direction, words, mount):
    result = judged(arm, truth=pulled(arm, *direction))
    first = result.quality.reasons[0]
    assert result.quality.verdict == BAD and words in first and "reverse" not in first
    assert advice(result).startswith("Use none") and not any("excite it" in x for x in result.quality.reasons)
    said = [float(x) for x in first.partition("robot.mount=[")[2].partition("]")[0].split(",")]
    turned = load_robot("kuka_lwr4", Setup(mount=tuple(said)))
    again = judged(turned, truth=load_robot("kuka_lwr4", Setup(mount=tuple(mount))))
    assert again.quality.verdict == GOOD
    assert again.tested["consistent"].nmse_mean < 0.5 * result.tested["consistent"].nmse_mean


def test_torques_without_gravity_are_named(arm):
    result = judged(arm, without_gravity(arm))
    assert result.quality.verdict == BAD and "contain no gravity" in result.quality.reasons[0]


@pytest.mark.parametrize(
    ("factors", "verdict", "words"),
    [
        ([0.25] * 7, USABLE, "0.25 (joint_1), 0.25 (joint_2)"),
        ([0.25] * 3 + [1.0] * 4, BAD, "0.25 (joint_1), 0.25 (joint_2), 0.25 (joint_3) times that"),
        ([3.0, *[1.0] * 6], USABLE, "3 (joint_1) times that"),
        ([0.7] * 7, GOOD, ""),
    ],
)
def test_torques_at_another_scale_than_described_are_named(arm, factors, verdict, words):
    result = judged(arm, scaled(*factors))
    assert result.quality.verdict == verdict and words in result.quality.reasons[0]


def test_reversed_torques_are_no_reversed_gravity(arm):
    (recording, _) = recordings(arm, scaled(1, -1, 1, 1, 1, 1, 1))
    assert any("recording.reverse=[joint_2]" in warning for warning in recording.warnings)
    every, _ = recordings(arm, scaled(*[-1] * 7))
    assert not every.agreement.turned and "recording.reverse=[joint_1" in "\n".join(every.warnings)


def late(made):
    """Torques of 200 ms before."""
    return np.roll(made.torque, 20, 0)


def offset(made):
    return made.torque + np.array([0, 0, 9.0, 0, 0, 0, 0])


def heavier(arm):
    """The arm with 2 kg in its hand."""
    links = arm.inertial_parameters.copy()
    links[-1, [0, 3]] += [2.0, 0.2]
    return replace(arm, inertial_parameters=links)


CAUSES = [
    (late, "^torques are 200 ± .* later than the motion: left as it is; recording.delay=null takes"),
    (scaled(1, -1, 1, 1, 1, 1, 1), r"^the torque of joint_2 runs against .*recording.reverse=\[joint_2\]"),
    (
        lambda made: made.torque[:, [0, 2, 1, 3, 4, 5, 6]],
        "^torques look swapped: that of joint_2 is what joint_3",
    ),
    (scaled(1, 1, 1, 1.1, 1, 1, 1), "^the torque of joint_4 is 1.1. times what the other joints"),
    (offset, r"^joint 3 \(joint_3\): its torque has an offset of 9.* ± .* was the sensor tared"),
]


@pytest.mark.parametrize(("change", "words"), CAUSES)
def test_a_fault_of_the_recordings_is_the_first_reason_and_silences_advice(arm, change, words):
    quality = judged(arm, change).quality
    assert re.search(words, quality.reasons[0]) and quality.causes
    if quality.verdict != GOOD:
        assert not any("excite it" in reason for reason in quality.reasons)


def test_motions_in_each_others_columns_are_named(arm):
    order = [0, 3, 2, 1, 4, 5, 6]
    made = moved(arm, np.arange(1500) / 100, VISCOUS[0], COULOMB[0], np.random.default_rng(0), period=6.0)
    swapped = replace(made, position=made.position[:, order], velocity=made.velocity[:, order])
    checked = check_recording(swapped, arm, of_file())
    assert "the motions of joint_2 and joint_4 look swapped" in checked.warnings[0]
    quality = identified(arm, [checked], strength=1.0).quality
    assert quality.verdict == BAD and "look swapped" in quality.reasons[0]


def test_one_recording_with_another_load_is_named(arm):
    training, validation = (
        recordings(arm, lambda made: made.torque)[0],
        recordings(arm, lambda made: made.torque, heavier(arm))[1],
    )
    validation = replace(validation, statistics=replace(validation.statistics, name="carrying"))
    quality = identified(arm, [training], [validation], strength=1.0).quality
    assert re.search(r"^carrying was recorded with another load .*: \+2 ± .* kg on ", quality.reasons[0])


def test_torques_of_motors_are_distinguished_from_those_behind_gears(arm):
    """MuJoCo's rotors are in the drives' torques, which the model of joint torques lacks."""
    rotors = np.array([3.0, 3, 2, 2, 0.5, 0.5, 0.2])
    with_rotors = judged(arm, lambda made: made.torque + rotors * np.gradient(made.velocity, 0.01, axis=0))
    words = "^rotors explain what is left: with model=motor_current the mean nMSE is (.*?), it is "
    assert float(re.search(words, with_rotors.quality.reasons[0])[1]) < 0.01


@pytest.mark.parametrize(("size", "told"), [(1.0, True), (0.02, False)])
def test_a_joint_that_hardly_moves_tells_no_sign(arm, size, told):
    made = moved(arm, np.arange(1500) / 100, 0.0, 0.0, np.random.default_rng(0), period=6.0)
    q, v = (x * [1, 1, 1, 1, 1, size, 1] for x in (made.position, made.velocity))
    torque = RigidBody(arm).torque(q, v, np.gradient(v, 0.01, axis=0))
    torque[:, 5] *= -1
    checked = check_recording(replace(made, position=q, velocity=v, torque=torque), arm, of_file())
    warnings = "\n".join(checked.warnings)
    assert ("reverse=[joint_6]" in warnings) == told
    unknown = re.search("does not show whether the sign of the torque of .*joint_6", warnings)
    assert (unknown is None) == told


@pytest.mark.parametrize(("found", "said"), [(19.9, 0), (20.1, 1), (0.201, 0), (0.199, 1)])
def test_an_arm_ten_times_as_heavy_as_described_is_named(found, said):
    assert [finding.level for finding in implausible_mass(found, 2.0)] == said * [USABLE]


def test_links_that_no_arm_has_are_named(arm):
    links = arm.inertial_parameters.copy()
    assert implausible_links(arm, links) == []
    links[3] *= 12
    assert [(finding.level, finding.joint) for finding in implausible_links(arm, links)] == [(USABLE, 3)]
    links = arm.inertial_parameters.copy()
    links[2, 1] = 2.0 * links[2, 0]
    (found,) = implausible_links(arm, links)
    assert found.level == BAD and "further than the arm reaches" in found.text
